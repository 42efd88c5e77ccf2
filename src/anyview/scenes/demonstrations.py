"""Demonstrations in random scenes: two cameras' pictures of the first frame and of random moments."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from anyview.scenes import looks
from anyview.scenes.camera import Sensor, View, sample_view
from anyview.scenes.operator import sample_operator
from anyview.scenes.shapes import Colour, moved, yaw
from anyview.scenes.studio import Light, studio
from anyview.scenes.tabletop import sample_object, sample_room, sample_target, sample_things
from anyview.surrogate.push import OBJECT_RADIUS, TARGET_HALF, Push, sample_push
from anyview.trigonometry import unit_vector
from anyview.video.marks import where_leaving

VIEWS = ("left", "right")
MARKS = ("object", "target", "tool", "wrist", "elbow")
DURATION = 8.0  # seconds that a clip lasts

SUPERSAMPLING = 4


@dataclass(frozen=True)
class Demonstration:
    """``clips``, uint8 (2, 1 + moments, size, size, 3), and the ``times`` of both, in seconds.

    ``marks`` (2, 1 + moments, 5, 2) are where the things named in ``MARKS`` are, x and y in pixels, also if
    hidden. Instead of joints outside of the picture there is the place where the arm leaves it.
    """

    clips: np.ndarray
    times: np.ndarray
    marks: np.ndarray
    push: Push
    views: tuple[View, View]


def render_demonstration(rng: np.random.Generator, moments: int, size: int) -> Demonstration:
    """A demonstration of the rig in a scene of its own: ``moments`` random ones after the first frame.

    Moments are in order, one in each of as many equal parts of the clip.
    """
    push, views = _sample_views(rng)
    table = looks.table_colour(rng)
    thing = sample_object(rng, table)
    operator = sample_operator(rng)
    standing = sample_room(rng, table, [view.azimuth for view in views])
    standing += sample_target(rng, push, table, thing[0].surface.colour)
    standing += sample_things(rng, push, thing[0].surface.colour)
    tones = (table, looks.table_colour(rng), looks.colour(rng))
    pictures = [looks.texture(rng, tone) for tone in tones]
    drawn = SUPERSAMPLING * size
    camera = studio(drawn)
    camera.arrange(standing, _sample_lights(rng), [view.camera for view in views], pictures)
    sensors = [Sensor(rng, view.lens, drawn, size) for view in views]
    times = np.concatenate([[0.0], (np.arange(moments) + rng.random(moments)) * (DURATION / moments)])
    clips = np.empty((2, len(times), size, size, 3), np.uint8)
    marks = np.empty((2, len(times), len(MARKS), 2), np.float32)
    spin = yaw(rng.uniform(0.0, 2 * np.pi))
    for index, time in enumerate(times.tolist()):
        cup, object_xy = push.at(time)
        moving = [*operator.posed(cup), *moved(thing, (*object_xy, 0.0005), spin)]
        for clip, sensor, picture in zip(clips, sensors, camera.shoot(moving), strict=True):
            clip[index] = sensor.expose(picture)
        wrist, elbow, _ = operator.joints(cup)
        points = np.stack(
            [(*object_xy, 0.02), (*push.target_xy, 0.0), (*cup[:2], cup[2] + 0.02), wrist, elbow]
        )
        for places, view in zip(marks, views, strict=True):
            shown = view.lens.seen(view.camera.project(points))
            for joint in range(MARKS.index("wrist"), len(MARKS)):
                shown[joint] = where_leaving(shown[joint - 1], shown[joint])
            places[index] = 0.5 * size * (shown + 1.0) - 0.5
    return Demonstration(clips, times, marks, push, views)


def _sample_views(rng: np.random.Generator) -> tuple[Push, tuple[View, View]]:
    while True:
        push = sample_push(rng)
        points = _outline(push)
        arm = float(push.cup[-1, 3]) + np.pi  # where the arm comes from, seen from the target
        sides = (True, False) if rng.random() < 0.8 else (bool(rng.integers(2)),) * 2
        first, second = (sample_view(rng, points, arm, left) for left in sides)
        if first is not None and second is not None:
            return push, (first, second)


def _outline(push: Push) -> np.ndarray:
    """Points (N, 3) around the object's path and at the target's corners."""
    around = OBJECT_RADIUS * unit_vector(np.arange(4) * (0.5 * np.pi))
    path = (push.object_xy[:: len(push.object_xy) // 6, None] + around).reshape(-1, 2)
    corners = push.target_xy + TARGET_HALF * 1.4 * unit_vector(
        push.target_yaw + np.pi * (0.25 + 0.5 * np.arange(4))
    )
    flat = np.concatenate([path, corners])
    return np.column_stack([flat, np.full(len(flat), 0.02)])


def _sample_lights(rng: np.random.Generator) -> Sequence[Light]:
    """A lamp or the sun, most often with shadows, and light from elsewhere."""
    ambient = rng.uniform(0.2, 0.5)
    lamp = rng.uniform(0.2, 0.65)
    fill = rng.uniform(0.0, 0.4)
    return [
        Light(
            position=_direction(rng, 35, 88) * rng.uniform(1.1, 2.6),
            diffuse=_white(rng, lamp),
            ambient=_white(rng, ambient),
            specular=rng.uniform(0.0, 0.4),
            cutoff=rng.uniform(45.0, 80.0) if rng.random() < 0.6 else None,
            exponent=rng.uniform(0.0, 4.0),
            casts_shadow=rng.random() < 0.88,
        ),
        Light(
            position=_direction(rng, 10, 80) * 2.0,
            diffuse=_white(rng, fill),
            ambient=(0.05, 0.05, 0.05),
            specular=0.0,
            cutoff=None,
            exponent=0.0,
            casts_shadow=False,
        ),
    ]


def _white(rng: np.random.Generator, level: float) -> Colour:
    """A warm or a cold white."""
    warmth = rng.normal(0.0, 0.05)
    return level * (1.0 + warmth), level, level * (1.0 - warmth)


def _direction(rng: np.random.Generator, lowest: float, highest: float) -> np.ndarray:
    """A unit vector (3,) between two elevations in degrees."""
    east, north = unit_vector(rng.uniform(0, 2 * np.pi))
    level, rise = unit_vector(np.radians(rng.uniform(lowest, highest)))
    return np.array([level * east, level * north, rise])
