"""How time falls with workers: the same simulated shards by local processes and by Ray.

    python benchmarks/workers.py [--shards 8] [--demos 25] [--rounds 2] [--workers 1 2]

Every way makes all the shards anew, in rounds that alternate; the fastest of each counts. Workers are
started and warm before the clock runs. Ratios are to one local process.
"""

import argparse
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import joblib
import numpy as np

from anyview.pusher.contexts import sample_contexts
from anyview.pusher.expert import roll_out
from anyview.pusher.render import renderer
from anyview.runtime.workers import run_tasks
from anyview.seeds import stream
from anyview.video.sets import write_shard

SIZE = 64


def simulate(folder: Path, index: int, count: int) -> str:
    """What the stage `simulate` does for one shard; returns the checksum of its file."""
    contexts, _ = sample_contexts(stream(1, "benchmark", index), count)
    positions, _ = roll_out(contexts)
    camera = renderer("push", SIZE)
    clips = np.stack([camera.render_clip(*scene) for scene in zip(contexts, positions, strict=True)])
    return write_shard(folder, index, clips).sha256


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--shards", type=int, default=8)
    parser.add_argument("--demos", type=int, default=25)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--workers", type=int, nargs="+", default=[1, joblib.cpu_count()])
    options = parser.parse_args()

    def way(backend: str, workers: int) -> Callable[[], tuple[float, list[str]]]:
        def run() -> tuple[float, list[str]]:
            os.environ |= {"ANYVIEW_BACKEND": backend, "ANYVIEW_WORKERS": str(workers)}
            with tempfile.TemporaryDirectory() as folder:
                list(run_tasks(simulate, [(Path(folder), index, 1) for index in range(workers)]))
                began = time.perf_counter()
                tasks = [(Path(folder), index, options.demos) for index in range(options.shards)]
                found = list(run_tasks(simulate, tasks))
                return time.perf_counter() - began, found

        return run

    ways = {f"local, {count}": way("local", count) for count in options.workers}
    if options.workers[-1] > 1:  # a Ray of this machine's own has as many workers throughout
        ways[f"ray, {options.workers[-1]}"] = way("ray", options.workers[-1])
    best = dict.fromkeys(ways, float("inf"))
    checksums = set()
    for _ in range(options.rounds):
        for name, run in ways.items():
            seconds, found = run()
            best[name] = min(best[name], seconds)
            checksums.add(tuple(found))
    first = best[next(iter(best))]
    print(f"{'workers':12} {'seconds':>8} {'ratio':>6} {'demonstrations/s':>17}")
    for name, seconds in best.items():
        rate = options.shards * options.demos / seconds
        print(f"{name:12} {seconds:8.1f} {first / seconds:5.2f}x {rate:17.0f}")
    print(
        "bytes: the same every time" if len(checksums) == 1 else f"bytes: {len(checksums)} DIFFERENT results"
    )


if __name__ == "__main__":
    main()
