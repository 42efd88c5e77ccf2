"""Ingest against a plain loop of the same library, over the same surrogate clips in one run.

    python benchmarks/ingest.py [--clips 48] [--rounds 3]

Rounds alternate, and the fastest of each counts: what else the machine does can only slow it down.
"""

import argparse
import os
import shutil
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import av
import cv2
from av.video.reformatter import VideoReformatter

from anyview.config import load_params
from anyview.ingest.clips import Candidate, ingest_clip
from anyview.runtime.workers import run_tasks
from anyview.surrogate.film import film, plan

DEMONSTRATIONS = 4  # filmed once; their clips are listed again until there are enough


def plain_loop(paths: list[Path], folder: Path, size: int) -> None:
    """Read every frame, resize it, write it: no checks, no resampling."""
    for index, path in enumerate(paths):
        with av.open(str(path)) as source, av.open(str(folder / f"{index}.avi"), "w") as target:
            source.streams.video[0].codec_context.thread_count = 1
            converter = VideoReformatter()
            stream = target.add_stream("mpeg4", 10)
            stream.width = stream.height = size
            stream.pix_fmt, stream.codec_context.thread_count = "yuv420p", 1
            for frame in source.decode(video=0):
                picture = converter.reformat(frame, format="rgb24", threads=1).to_ndarray()
                small = cv2.resize(picture, (size, size), interpolation=cv2.INTER_AREA)
                target.mux(stream.encode(av.VideoFrame.from_ndarray(small, "rgb24")))
            target.mux(stream.encode())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--clips", type=int, default=48)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    params = load_params().real

    with tempfile.TemporaryDirectory() as root:
        raw = Path(root, "raw")
        raw.mkdir()
        rows = [row for shot in plan(DEMONSTRATIONS, 0, 0) for row in film(raw, shot, params.film.width, 0)]
        files = [rows[index % len(rows)]["file"] for index in range(options.clips)]
        candidates = [Candidate(f"{i:04d}", file, str(i), "", "standard") for i, file in enumerate(files)]

        def ingest(workers: int) -> Callable[[Path], None]:
            def run(folder: Path) -> None:
                os.environ["ANYVIEW_WORKERS"] = str(workers)
                tasks = [(raw, folder, candidate, params.ingest) for candidate in candidates]
                assert all(not verdict.reason for verdict in run_tasks(ingest_clip, tasks))

            return run

        contestants: dict[str, Callable[[Path], None]] = {
            "plain loop": lambda folder: plain_loop(
                [raw / file for file in files], folder, params.ingest.size
            ),
            "ingest, 1 worker": ingest(1),
            "ingest, 2 workers": ingest(2),
        }
        best = dict.fromkeys(contestants, float("inf"))
        for _ in range(options.rounds):
            for name, contestant in contestants.items():
                (folder := Path(root, "out")).mkdir()
                began = time.perf_counter()
                contestant(folder)
                best[name] = min(best[name], time.perf_counter() - began)
                shutil.rmtree(folder)

    size = f"{params.film.width} x {params.film.width * 9 // 16}"
    print(f"{options.clips} clips of {size}, {os.cpu_count()} cores")
    for name, seconds in best.items():
        speed = options.clips / seconds
        print(f"{name:18} {speed:7.1f} clips/s {best['plain loop'] / seconds:6.2f} x the plain loop")
    print(f"two workers against one: {best['ingest, 1 worker'] / best['ingest, 2 workers']:.2f} x")


if __name__ == "__main__":
    main()
