"""Stage `simulate`: demonstrations of the scripted expert as lossless video shards with a manifest.

Usage: python stages/simulate.py SET
"""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from anyview import paths
from anyview.config import load_params
from anyview.pusher.contexts import Kind, sample_contexts
from anyview.pusher.expert import roll_out
from anyview.pusher.render import renderer
from anyview.pusher.task import load_task
from anyview.pusher.tempo import draw_progress
from anyview.runtime.errors import choose, run_stage
from anyview.runtime.once import once
from anyview.runtime.outputs import whole_folder, write_atomically
from anyview.runtime.progress import track
from anyview.runtime.scratch import checkpoint_folder
from anyview.runtime.workers import run_tasks
from anyview.seeds import stream
from anyview.video.sets import StoredFile, write_set, write_shard


def simulate_shard(
    folder: Path,
    seed: int,
    name: str,
    task: str,
    kind: Kind,
    varied: bool,
    index: int,
    count: int,
    image_size: int,
) -> dict[str, Any]:
    """Make shard ``index`` of the set ``name``, of ``count`` demonstrations, unless an earlier try did.

    Returns its row of files.csv, its rows of the manifest and the acceptance rate of contexts.
    """

    def make() -> tuple[dict[str, Any], list[str]]:
        rng = stream(seed, f"demonstrations/{name}", index)
        contexts, acceptance = sample_contexts(rng, count, kind, task)
        progress = draw_progress(rng, count, task) if varied else None
        positions, distances = roll_out(contexts, progress)
        camera = renderer(task, image_size)
        clips = [camera.render_clip(*scene) for scene in zip(contexts, positions, strict=True)]
        stored = write_shard(folder, index, np.stack(clips))
        rows = [
            {
                "clip": f"{name}-{index:04d}-{position:04d}",
                "shard": index,
                "position": position,
                "success": bool(distance < load_task(task).tolerance),
                "final_distance": float(distance),
                "context": context.to_json(),
            }
            | ({"choice": context.choice.colour} if context.choice else {})
            | ({} if progress is None else {"progress": " ".join(map(str, progress[position]))})
            for position, (context, distance) in enumerate(zip(contexts, distances, strict=True))
        ]
        return {"file": vars(stored), "rows": rows, "acceptance": acceptance}, [stored.file]

    return once(folder, f"shard-{index:04d}-{count}", make)


def main(arguments: list[str]) -> None:
    """Simulate one set; a killed stage continues after the last finished shard."""
    params = load_params()
    sets = params.demonstration_sets
    name = choose(arguments, sets, "python stages/simulate.py SET")
    wanted, shard, size = sets[name], params.simulate.shard, params.sim.image_size
    what = (params.base.seed, name, wanted.task, wanted.contexts, wanted.tempo == "varied")
    folder = checkpoint_folder(["simulate", *what, shard, size])

    counts = [min(shard, wanted.demos - first) for first in range(0, wanted.demos, shard)]
    tasks = [(folder, *what, index, count, size) for index, count in enumerate(counts)]
    records = []
    with track(f"simulate {name}", wanted.demos) as progress:
        for record in run_tasks(simulate_shard, tasks):
            records.append(record)
            progress.advance(record["file"]["clips"])

    manifest = pd.DataFrame([row for record in records for row in record["rows"]])
    files = [StoredFile(**record["file"]) for record in records]
    with whole_folder(paths.clip_set(name)) as output:
        for stored in files:
            shutil.copyfile(folder / stored.file, output / stored.file)
        write_set(output, manifest, files)
        summary = {
            "demos": len(manifest),
            "expert_success": float(manifest["success"].mean()),
            "acceptance": float(np.mean([record["acceptance"] for record in records])),
        }
        write_atomically(output / "summary.json", json.dumps(summary, indent=1) + "\n")
    shutil.rmtree(folder)


if __name__ == "__main__":
    run_stage(main)
