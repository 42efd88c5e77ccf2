"""One demonstration: a hand-held cup pushes an object over a table to a target. Kinematics only, no forces.

Lengths in metres, times in seconds. The table's top is the plane z = 0, the operator sits at its edge in -y.
"""

import math
from dataclasses import dataclass

import numpy as np

from anyview.trigonometry import unit_vector

OBJECT_RADIUS = 0.045
TARGET_HALF = 0.065
CUP_HALF_WIDTH = 0.051  # inner: the object fits between the fingers with a little play
CUP_DEPTH = 0.065
DURATION = 8.6
STEP = 0.01
_KNOTS = (0.5, 2.3, 2.6, 6.8, 7.2, 8.2)  # hand leaves rest, arrives, pushes, done, lets go, withdrawn


@dataclass(frozen=True)
class Push:
    """A demonstration sampled every ``STEP`` seconds."""

    cup: np.ndarray  # (T, 4): x, y, height and heading of the cup; its mouth looks along the heading
    object_xy: np.ndarray  # (T, 2)
    target_xy: np.ndarray  # (2,)
    target_yaw: float

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Cup (4,) and object (2,) at ``time``, clamped to the demonstration."""
        index = min(max(round(time / STEP), 0), len(self.cup) - 1)
        return self.cup[index], self.object_xy[index]


def sample_push(rng: np.random.Generator) -> Push:
    """A demonstration at random places that ends with the object within 2 cm of the target's centre."""
    while True:
        push = _try_push(rng)
        if push is not None:
            return push


def _try_push(rng: np.random.Generator) -> Push | None:
    start_xy = np.array([rng.uniform(-0.24, 0.24), rng.uniform(-0.20, 0.06)])
    # Pushed away from the operator or sideways: towards oneself, the tool would stand in the way.
    course = np.pi / 2 + rng.uniform(-1.25, 1.25)
    target_xy = start_xy + rng.uniform(0.22, 0.36) * unit_vector(course)
    if abs(target_xy[0]) > 0.27 or target_xy[1] > 0.25:
        return None
    bend = rng.uniform(-0.35, 0.35)
    touch = OBJECT_RADIUS + 0.002
    before = start_xy - (touch + 0.012) * unit_vector(course + bend)
    after = target_xy - touch * unit_vector(course - bend)
    rest = before + np.array([rng.uniform(-0.06, 0.06), -rng.uniform(0.10, 0.16)])

    times = np.arange(0.0, DURATION, STEP)
    knots = np.array(_KNOTS) + rng.normal(0.0, 0.07, len(_KNOTS))
    approach = _progress(times, knots[0], knots[1])
    pushed = _progress(times, knots[2], knots[3])
    withdrawn = _progress(times, knots[4], knots[5])

    path = _hermite(rest, before, np.pi / 2, course + bend, approach)
    path += _hermite(before, after, course + bend, course - bend, pushed) - before
    path -= withdrawn[:, None] * 0.07 * unit_vector(course - bend)
    sway = np.stack([_wander(rng, times, 0.5) for _ in range(2)], axis=1) * 0.0025
    tremor = np.stack([_wander(rng, times, 5.0) for _ in range(2)], axis=1) * 0.0006
    path += sway + tremor
    rest_heading = np.pi / 2 + rng.uniform(-0.3, 0.3)
    heading = rest_heading + approach * (course + bend - rest_heading) - pushed * 2 * bend
    heading += 0.03 * _wander(rng, times, 0.7)
    lift = 0.03 * np.maximum(1.0 - approach / 0.8, 0.0) + 0.025 * withdrawn
    height = lift + 0.0008 * np.abs(_wander(rng, times, 6.0))

    cup = np.column_stack([path, height, heading])
    object_xy = _pushed_object(start_xy, cup)
    moved_early = np.linalg.norm(object_xy[times < knots[2]] - start_xy, axis=1).max() > 0.004
    if moved_early or math.dist(object_xy[-1], target_xy) > 0.02:
        return None
    return Push(cup, object_xy, target_xy, rng.uniform(-0.4, 0.4))


def _progress(times: np.ndarray, begin: float, end: float) -> np.ndarray:
    """Minimum-jerk progress from 0 at ``begin`` to 1 at ``end`` (Flash and Hogan 1985)."""
    s = np.clip((times - begin) / (end - begin), 0.0, 1.0)
    return s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)


def _hermite(begin: np.ndarray, end: np.ndarray, course0: float, course1: float, s: np.ndarray) -> np.ndarray:
    """Cubic Hermite curve (T, 2) that leaves ``begin`` on ``course0`` and reaches ``end`` on ``course1``."""
    length = math.dist(begin, end)
    s = s[:, None]
    arrived = s * s * (3 - 2 * s)
    return (
        (1 - arrived) * begin
        + arrived * end
        + s * (1 - s) * length * ((1 - s) * unit_vector(course0) - s * unit_vector(course1))
    )


def _wander(rng: np.random.Generator, times: np.ndarray, frequency: float) -> np.ndarray:
    """Smooth noise (T,) of unit size around ``frequency`` hertz: a hand is never quite still."""
    waves = frequency * rng.uniform(0.6, 1.6, 4)
    phases = rng.uniform(0.0, 2 * np.pi, 4)
    return unit_vector(2 * np.pi * waves * times[:, None] + phases)[..., 1].sum(axis=1) / np.sqrt(2.0)


def _pushed_object(start_xy: np.ndarray, cup: np.ndarray) -> np.ndarray:
    """Where the cup takes the object (T, 2): it moves only when crossbar or finger pushes (quasi-static)."""
    object_x, object_y = start_xy.tolist()
    track = np.empty((len(cup), 2))
    play = CUP_HALF_WIDTH - OBJECT_RADIUS
    forward = unit_vector(cup[:, 3])
    for index, (x, y, height, forward_x, forward_y) in enumerate(np.hstack([cup[:, :3], forward]).tolist()):
        ahead = (object_x - x) * forward_x + (object_y - y) * forward_y
        aside = (object_y - y) * forward_x - (object_x - x) * forward_y
        if height < 0.015 and abs(aside) < CUP_HALF_WIDTH and -OBJECT_RADIUS < ahead < CUP_DEPTH:
            ahead = max(ahead, OBJECT_RADIUS)
            aside = min(max(aside, -play), play)
            object_x = x + ahead * forward_x - aside * forward_y
            object_y = y + ahead * forward_y + aside * forward_x
        track[index] = object_x, object_y
    return track
