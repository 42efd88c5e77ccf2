"""Frames a second of stage `render` against those of stage `film`, at equal picture size.

    python benchmarks/scenes.py [--demonstrations 12] [--rounds 3]

Film draws a picture of 0.6 times its width and bends it; render draws squares. The width compared with is the
one at which both draw about as many pixels. Speeds are in the processor's seconds on one thread, videos
included; rounds alternate, and the fastest of each counts.
"""

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import pandas as pd

from anyview.config import load_params
from anyview.scenes.demonstrations import SUPERSAMPLING, render_demonstration
from anyview.seeds import stream
from anyview.surrogate.film import RENDER_SCALE, film, plan
from anyview.video.manifests import times_file
from anyview.video.sets import write_clips

ASPECT = 9 / 16
DEFAULT_PROFILE = 3000  # demonstrations


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--demonstrations", type=int, default=12, help="of render; film makes one a round")
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    params = load_params().real
    size, moments = params.ingest.size, params.render.moments
    side = size * SUPERSAMPLING
    equal = 32 * round(side / RENDER_SCALE / ASPECT**0.5 / 32)

    def filming(width: int) -> Callable[[Path, int], int]:
        def run(folder: Path, index: int) -> int:
            shot = plan(options.rounds, 0, 0)[index]
            rows = film(folder, shot, width, seed=index)
            return sum(len(pd.read_csv(folder / times_file(row["file"]))) for row in rows)

        return run

    def rendering(folder: Path, index: int) -> int:
        for number in range(options.demonstrations):
            rng = stream(index, "benchmark scenes", number)
            clips = render_demonstration(rng, moments, size).clips
            write_clips(folder / f"{number}.avi", clips, 10.0, "XVID")
        return options.demonstrations * 2 * (1 + moments)

    contestants = {
        f"film, {equal} wide": filming(equal),
        f"film, {params.film.width} wide, as in params": filming(params.film.width),
        f"render, {side} to {size}": rendering,
    }
    speeds = dict.fromkeys(contestants, 0.0)
    for index in range(options.rounds):
        for name, contestant in contestants.items():
            with tempfile.TemporaryDirectory() as folder:
                began = time.process_time()
                frames = contestant(Path(folder), index)
                speeds[name] = max(speeds[name], frames / (time.process_time() - began))
    first = next(iter(speeds))
    for name, speed in speeds.items():
        print(f"{name:30} {speed:7.1f} frames/s {speed / speeds[first]:6.2f} x {first}")
    minutes = DEFAULT_PROFILE * 2 * (1 + moments) / speeds[f"render, {side} to {size}"] / 60
    print(f"{DEFAULT_PROFILE} demonstrations take {minutes:.1f} minutes of one core")


if __name__ == "__main__":
    main()
