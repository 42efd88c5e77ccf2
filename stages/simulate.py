"""Stage `simulate`: demonstrations of the scripted expert as lossless video shards with a manifest.

Usage: python stages/simulate.py diverse|narrow
"""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from anyview.config import load_params
from anyview.pusher.batch import TOLERANCE
from anyview.pusher.contexts import Kind, sample_contexts
from anyview.pusher.expert import roll_out
from anyview.pusher.render import renderer
from anyview.runtime.errors import AnyviewError, run_stage
from anyview.runtime.outputs import whole_folder, write_atomically
from anyview.runtime.progress import track
from anyview.runtime.scratch import content_key, scratch_folder
from anyview.runtime.workers import run_units
from anyview.seeds import stream
from anyview.video.sets import StoredFile, stored_file, write_set, write_shard


def simulate_shard(
    folder: Path, seed: int, kind: Kind, index: int, count: int, image_size: int
) -> dict[str, Any]:
    """Make shard ``index`` of ``count`` demonstrations in ``folder``, unless an earlier try finished it.

    Returns its record, which lies beside it as JSON: file, rows of the manifest, acceptance rate.
    """
    record_path = folder / f"shard-{index:04d}.json"
    if (record := _finished(folder, record_path)) is not None:
        return record
    contexts, acceptance = sample_contexts(stream(seed, f"demonstrations/{kind}", index), count, kind)
    positions, distances = roll_out(contexts)
    clips = np.stack(
        [renderer(image_size).render_clip(*scene) for scene in zip(contexts, positions, strict=True)]
    )
    stored = write_shard(folder, index, clips)
    rows = [
        {
            "clip": f"{kind}-{index:04d}-{position:04d}",
            "shard": index,
            "position": position,
            "success": bool(distance < TOLERANCE),
            "final_distance": float(distance),
            "context": context.to_json(),
        }
        for position, (context, distance) in enumerate(zip(contexts, distances, strict=True))
    ]
    record = {"file": vars(stored), "rows": rows, "acceptance": acceptance}
    write_atomically(record_path, json.dumps(record))
    return record


def _finished(folder: Path, record_path: Path) -> dict[str, Any] | None:
    """The record of a shard that is whole, by its checksum."""
    try:
        record = json.loads(record_path.read_text())
        expected = StoredFile(**record["file"])
        return (
            record
            if stored_file(folder / expected.file, expected.clips, expected.frames) == expected
            else None
        )
    except (OSError, ValueError, KeyError, TypeError):
        return None


def main(arguments: list[str]) -> None:
    """Simulate one set."""
    params = load_params()
    if arguments not in (["diverse"], ["narrow"]):
        raise AnyviewError("usage: python stages/simulate.py diverse|narrow")
    kind: Kind = "diverse" if arguments == ["diverse"] else "narrow"
    demos, shard = getattr(params.simulate, kind).demos, params.simulate.shard
    values = ["simulate", params.base.seed, kind, shard, params.sim.image_size]
    folder = scratch_folder("checkpoints", content_key(values))

    counts = [min(shard, demos - first) for first in range(0, demos, shard)]
    units = [
        (folder, params.base.seed, kind, index, count, params.sim.image_size)
        for index, count in enumerate(counts)
    ]
    records = []
    with track(f"simulate {kind}", demos) as progress:
        for record in run_units(simulate_shard, units):
            records.append(record)
            progress.advance(record["file"]["clips"])

    manifest = pd.DataFrame([row for record in records for row in record["rows"]])
    with whole_folder(Path("data/sim") / kind) as output:
        for record in records:
            shutil.copyfile(folder / record["file"]["file"], output / record["file"]["file"])
        write_set(output, manifest, [StoredFile(**record["file"]) for record in records])
        summary = {
            "demos": len(manifest),
            "expert_success": float(manifest["success"].mean()),
            "acceptance": float(np.mean([record["acceptance"] for record in records])),
        }
        write_atomically(output / "summary.json", json.dumps(summary, indent=1) + "\n")
    shutil.rmtree(folder)


if __name__ == "__main__":
    run_stage(main)
