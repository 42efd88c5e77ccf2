"""Stage `diversity-simulate`: the diverse demonstrations seen from fewer sides, into data/clips/views-<...>.

Usage, in evidence/: python diversity/simulate.py VIEWS CLUTTER
"""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from anyview import paths
from anyview.config import load_params
from anyview.diversity.sets import restriction
from anyview.pusher.contexts import Context
from anyview.pusher.expert import roll_out
from anyview.pusher.render import renderer
from anyview.runtime.errors import choose_each, run_stage
from anyview.runtime.once import once
from anyview.runtime.outputs import whole_folder, write_atomically
from anyview.runtime.progress import track
from anyview.runtime.scratch import checkpoint_folder
from anyview.runtime.workers import run_tasks
from anyview.video.datasets import dataset_files, progress_of
from anyview.video.manifests import read_table
from anyview.video.sets import StoredFile, write_set, write_shard


def render_shard(
    folder: Path, index: int, clips: pd.DataFrame, restrict: Callable[[Context], Context], image_size: int
) -> dict[str, Any]:
    """Make shard ``index``: the demonstrations of ``clips``, restricted; unless an earlier try did.

    Returns its row of files.csv and the contexts that it shows.
    """

    def make() -> tuple[dict[str, Any], list[str]]:
        shown = [restrict(Context.from_json(text)) for text in clips["context"]]
        positions, _ = roll_out(shown, progress_of(clips))
        camera = renderer(shown[0].task, image_size)
        filmed = [camera.render_clip(*scene) for scene in zip(shown, positions, strict=True)]
        stored = write_shard(folder, index, np.stack(filmed))
        return {"file": vars(stored), "contexts": [context.to_json() for context in shown]}, [stored.file]

    return once(folder, f"shard-{index:04d}", make)


def main(arguments: list[str]) -> None:
    """Make one set; a killed stage continues after the last finished shard.

    Clips keep the ids that they have in the diverse set, so that its split is theirs.
    """
    params = load_params()
    diversity, source = params.evidence.diversity, params.imitation.dataset
    views, clutter = choose_each(
        arguments, {"VIEWS": diversity.views, "CLUTTER": paths.CLUTTER}, "diversity/simulate.py"
    )
    name, size = paths.restricted_set(views, clutter), params.sim.image_size
    manifest = read_table(
        paths.clip_set(source) / "manifest.csv", ["clip", "shard", "context"], unique="clip"
    )
    folder = checkpoint_folder(["diversity-simulate", name, size], dataset_files(source))

    tasks = [
        (folder, index, rows, restriction(views, clutter), size)
        for index, (_, rows) in enumerate(manifest.groupby("shard", sort=False))
    ]
    records = []
    with track(f"simulate {name}", len(manifest)) as progress:
        for record in run_tasks(render_shard, tasks):
            records.append(record)
            progress.advance(record["file"]["clips"])

    files = [StoredFile(**record["file"]) for record in records]
    contexts = [context for record in records for context in record["contexts"]]
    with whole_folder(paths.clip_set(name)) as output:
        for stored in files:
            shutil.copyfile(folder / stored.file, output / stored.file)
        write_set(output, manifest.assign(context=contexts), files)
    write_atomically(paths.split_table(name), paths.split_table(source).read_text(encoding="utf-8"))
    shutil.rmtree(folder)


if __name__ == "__main__":
    run_stage(main)
