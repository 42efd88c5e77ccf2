"""Stage `render`: demonstrations of the rig in random scenes, to pretrain on, as a set of pairs of clips."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from anyview import paths
from anyview.config import load_params
from anyview.runtime.errors import refuse_arguments, run_stage
from anyview.runtime.once import once
from anyview.runtime.outputs import whole_folder
from anyview.runtime.progress import track
from anyview.runtime.scratch import checkpoint_folder
from anyview.runtime.workers import run_tasks
from anyview.scenes.demonstrations import VIEWS, render_demonstration
from anyview.seeds import stream
from anyview.video.marks import write_marks
from anyview.video.sets import StoredFile, write_clips, write_set

_SHARD = 20  # demonstrations in one video file


def render_shard(
    folder: Path, seed: int, index: int, numbers: range, moments: int, size: int
) -> dict[str, Any]:
    """Render the demonstrations ``numbers`` as shard ``index``, unless an earlier try did.

    Returns its row of files.csv, its rows of the manifest and the file of its marks. Frames are stored with
    the losses that those of ingest have.
    """

    def make() -> tuple[dict[str, Any], list[str]]:
        demonstrations = [
            render_demonstration(stream(seed, "scenes", number), moments, size) for number in numbers
        ]
        clips = np.concatenate([demonstration.clips for demonstration in demonstrations])
        stored = write_clips(folder / f"shard-{index:04d}.avi", clips, 10.0, "XVID")
        marks = f"marks-{index:04d}.npy"
        np.save(folder / marks, np.concatenate([demonstration.marks for demonstration in demonstrations]))
        rows = [
            {
                "clip": f"{paths.RENDERED}-{number:05d}-{view}",
                "pair": f"{paths.RENDERED}-{number:05d}",
                "times": " ".join(f"{time:.2f}" for time in demonstration.times),
            }
            for number, demonstration in zip(numbers, demonstrations, strict=True)
            for view in VIEWS
        ]
        return {"file": vars(stored), "rows": rows, "marks": marks}, [stored.file, marks]

    return once(folder, f"shard-{index:04d}", make)


def main(arguments: list[str]) -> None:
    """Render the set; a killed stage continues after the last finished shard."""
    refuse_arguments(arguments, "python stages/render.py")
    params = load_params()
    wanted, size = params.real.render, params.real.ingest.size
    folder = checkpoint_folder(["render", params.base.seed, wanted.model_dump(), size])

    everything = range(wanted.demonstrations)
    shards = [everything[first : first + _SHARD] for first in everything[::_SHARD]]
    tasks = [
        (folder, params.base.seed, index, numbers, wanted.moments, size)
        for index, numbers in enumerate(shards)
    ]
    records = []
    with track("render", wanted.demonstrations) as progress:
        for numbers, record in zip(shards, run_tasks(render_shard, tasks), strict=True):
            records.append(record)
            progress.advance(len(numbers))
    files = [StoredFile(**record["file"]) for record in records]
    with whole_folder(paths.clip_set(paths.RENDERED)) as output:
        for stored in files:
            shutil.copyfile(folder / stored.file, output / stored.file)
        marks = [np.load(folder / record["marks"], allow_pickle=False) for record in records]
        write_marks(output, np.concatenate(marks))
        write_set(output, pd.DataFrame([row for record in records for row in record["rows"]]), files)
    shutil.rmtree(folder)


if __name__ == "__main__":
    run_stage(main)
