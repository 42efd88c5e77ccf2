"""What the rig films: which demonstrations, of which kind, seen by which two webcams."""

import math
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from anyview.runtime.once import once
from anyview.runtime.outputs import whole_folder, write_atomically
from anyview.runtime.progress import track
from anyview.runtime.workers import run_tasks
from anyview.seeds import stream
from anyview.surrogate.push import sample_push
from anyview.surrogate.scene import OTHER_TARGET_COLOURS, TARGET_COLOUR, Scene, View
from anyview.surrogate.things import place_things
from anyview.surrogate.webcam import Lens, Webcam, frame_times
from anyview.video.files import VideoWriter
from anyview.video.manifests import times_file

RATE = 10.0  # that the camera claims in its files; the true times lie in the sidecar
_DURATION = 8.15
RENDER_SCALE = 0.6  # a cheap webcam's picture is softer than its pixels: rendered smaller, then enlarged
# The two webcams, the same on every day of filming.
_LENSES = {"left": (0.75, -0.13, 0.020), "right": (0.80, -0.17, 0.030)}  # fovy in radians, k1, k2
_KINDS = ("standard", "distractor", "standard", "extreme_view", "standard", "distractor", "standard")


@dataclass(frozen=True)
class Demonstration:
    """One demonstration to film; ``pair`` is its id."""

    pair: str
    index: int
    kind: str
    cameras: tuple[str, ...]


def plan(pairs: int, singles: int, extreme_pairs: int) -> list[Demonstration]:
    """The demonstrations to film: ``pairs`` of mixed kinds, then singles, then extreme distractors."""
    kinds = [_KINDS[index % len(_KINDS)] for index in range(pairs)]
    shots = [("pair", kind, tuple(_LENSES)) for kind in kinds]
    shots += [("single", "standard", ("left",))] * singles
    shots += [("extreme", "extreme_distractor", tuple(_LENSES))] * extreme_pairs
    return [
        Demonstration(f"{name}-{index:03d}", index, kind, cameras)
        for index, (name, kind, cameras) in enumerate(shots)
    ]


def film_set(
    folder: Path, demonstrations: Sequence[Demonstration], width: int, seed: int, scratch: Path
) -> None:
    """Film ``demonstrations`` into ``folder``, with their manifest; continues from ``scratch``."""
    tasks = [(scratch, demonstration, width, seed) for demonstration in demonstrations]
    rows: list[dict[str, str]] = []
    with track("film", len(tasks)) as progress:
        for filmed in run_tasks(film, tasks):
            rows += filmed
            progress.advance()
    with whole_folder(folder) as output:
        for row in rows:
            for name in (row["file"], times_file(row["file"])):
                shutil.copyfile(scratch / name, output / name)
        write_atomically(output / "manifest.csv", pd.DataFrame(rows).to_csv(index=False))


def film(folder: Path, demonstration: Demonstration, width: int, seed: int) -> list[dict[str, str]]:
    """Film a demonstration into ``folder``, unless an earlier try finished it; returns its manifest rows.

    Each camera leaves ``<clip>.avi`` (XVID) and ``<clip>.times.csv``, the second at which each
    frame was taken, on one clock for both cameras. The manifest's ``azimuth`` is where it stands around the
    table, in degrees.
    """

    def make() -> tuple[list[dict[str, str]], list[str]]:
        rows = _film(folder, demonstration, width, seed)
        return rows, [name for row in rows for name in (row["file"], times_file(row["file"]))]

    return once(folder, demonstration.pair, make)


def _film(folder: Path, demonstration: Demonstration, width: int, seed: int) -> list[dict[str, str]]:
    rng = stream(seed, "film", demonstration.index)
    kind = demonstration.kind
    size = (width, width * 9 // 16)
    rendered = (round(size[0] * RENDER_SCALE), round(size[1] * RENDER_SCALE))
    push = sample_push(rng)
    lenses = [Lens(size, *_LENSES[camera]) for camera in demonstration.cameras]
    arm = float(push.cup[-1, 3]) + np.pi  # where the arm comes from, seen from the target
    views = [_sample_view(rng, kind, side, lens, arm) for side, lens in enumerate(lenses)]
    few, many = int(rng.integers(3, 7)), int(rng.integers(14, 20))
    count = {"distractor": few, "extreme_distractor": many}.get(kind, 0)
    things = place_things(rng, push, count)
    extreme = kind == "extreme_distractor"
    colour = OTHER_TARGET_COLOURS[rng.integers(len(OTHER_TARGET_COLOURS))] if extreme else TARGET_COLOUR
    scene = Scene(push, views, things, colour, rendered, rng)
    rows = []
    for index, (camera, lens) in enumerate(zip(demonstration.cameras, lenses, strict=True)):
        webcam = Webcam(lens, rendered, rng)
        times = frame_times(rng, _DURATION)
        file = f"{demonstration.pair}-{camera}.avi"
        with VideoWriter(folder / file, size, RATE, "XVID") as video:
            for time in times:
                video.write(webcam.expose(scene.render(index, time), time))
        pd.DataFrame({"seconds": times.round(4)}).to_csv(folder / times_file(file), index=False)
        row = {"file": file, "pair": demonstration.pair, "camera": camera, "kind": kind}
        azimuth = f"{np.degrees(views[index].azimuth) % 360:.1f}"
        rows.append(row | {"azimuth": azimuth})
    scene.close()
    return rows


def _sample_view(rng: np.random.Generator, kind: str, side: int, lens: Lens, arm: float) -> View:
    """A tripod's place, one camera on each side of the operator, who sits at azimuth -90 degrees.

    Nobody puts a camera where the arm, at azimuth ``arm`` in the end, would hide the target.
    """
    azimuth = arm
    while math.cos(azimuth - arm) > 0.55:
        azimuth = np.radians(rng.uniform(-35, 85) if side else rng.uniform(95, 215))
    elevation = np.radians(rng.uniform(36, 54))
    distance = rng.uniform(0.82, 0.98)
    roll = np.radians(rng.normal(0.0, 1.5))
    if kind == "extreme_view":
        elevation = np.radians(rng.uniform(70, 84) if rng.random() < 0.5 else rng.uniform(19, 26))
        roll = np.radians(rng.uniform(-14, 14))
    target = (rng.uniform(-0.03, 0.03), rng.uniform(-0.04, 0.06), 0.02)
    return View(azimuth, elevation, distance, target, roll, lens.undistorted()[1])
