"""What else lies on the table: mugs, books, pens."""

import math
from dataclasses import dataclass

import numpy as np

from anyview.surrogate.mjcf import geom, numbers, rgba
from anyview.surrogate.push import TARGET_HALF, Push

THING_COLOURS = (
    (0.20, 0.60, 0.25),
    (0.95, 0.80, 0.15),
    (0.93, 0.92, 0.88),
    (0.15, 0.15, 0.16),
    (0.45, 0.25, 0.12),
    (0.55, 0.55, 0.58),
    (0.92, 0.62, 0.70),
    (0.35, 0.70, 0.65),
)


@dataclass(frozen=True)
class Thing:
    """Something else on the table."""

    shape: str
    x: float
    y: float
    yaw: float
    colour: tuple[float, float, float]


_RADII = {
    "mug": 0.05,
    "box": 0.05,
    "book": 0.10,
    "ball": 0.03,
    "tape": 0.04,
    "bottle": 0.035,
    "pen": 0.07,
    "cube": 0.03,
}


def place_things(rng: np.random.Generator, push: Push, count: int) -> list[Thing]:
    """Put ``count`` things (fewer where there is no room) on the table, out of the way of the push."""
    swept = np.concatenate([push.cup[::20, :2], push.object_xy[::20]])
    placed: list[Thing] = []
    for _ in range(count * 12):
        shape = str(rng.choice(list(_RADII)))
        x, y = rng.uniform(-0.42, 0.42), rng.uniform(-0.26, 0.34)
        radius = _RADII[shape]
        clear = np.linalg.norm(swept - (x, y), axis=1).min() > radius + 0.075
        clear &= math.dist(push.target_xy, (x, y)) > radius + TARGET_HALF * 1.5
        clear &= all(math.dist((x, y), (t.x, t.y)) > radius + _RADII[t.shape] for t in placed)
        if clear:
            colour = THING_COLOURS[rng.integers(len(THING_COLOURS))]
            placed.append(Thing(shape, x, y, rng.uniform(0, 2 * np.pi), colour))
        if len(placed) == count:
            break
    return placed


def thing_xml(thing: Thing) -> str:
    look = rgba(thing.colour)
    pale = rgba([0.5 + 0.5 * channel for channel in thing.colour])
    geoms = {
        "mug": [
            geom("cylinder", (0.037, 0.045), (0, 0, 0.045), look),
            geom("cylinder", (0.032, 0.0005), (0, 0, 0.0901), rgba((0.16, 0.09, 0.05))),
            geom("capsule", (0.006, 0.02), (0.052, 0, 0.045), look),
        ],
        "box": [geom("box", (0.045, 0.03, 0.02), (0, 0, 0.02), look)],
        "book": [
            geom("box", (0.075, 0.055, 0.010), (0, 0, 0.010), rgba((0.9, 0.88, 0.8))),
            geom("box", (0.077, 0.057, 0.001), (0, 0, 0.021), look),
        ],
        "ball": [geom("sphere", (0.028,), (0, 0, 0.028), look)],
        "tape": [
            geom("cylinder", (0.04, 0.012), (0, 0, 0.012), look),
            geom("cylinder", (0.022, 0.0005), (0, 0, 0.0245), rgba((0.35, 0.28, 0.2))),
        ],
        "bottle": [
            geom("cylinder", (0.03, 0.07), (0, 0, 0.07), look),
            geom("cylinder", (0.012, 0.02), (0, 0, 0.16), pale),
        ],
        "pen": [geom("capsule", (0.005, 0.065), (0, 0, 0.005), look, euler="90 0 0")],
        "cube": [geom("box", (0.024, 0.024, 0.024), (0, 0, 0.024), look)],
    }[thing.shape]
    at = numbers(thing.x, thing.y, 0)
    return f'<body pos="{at}" euler="0 0 {np.degrees(thing.yaw):.2f}">{"".join(geoms)}</body>'
