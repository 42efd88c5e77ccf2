"""What is on the table and around it: object, target, other things, the room."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from anyview.scenes import looks
from anyview.scenes.shapes import Colour, Shape, Surface, box, capsule, cylinder, ellipsoid, moved, yaw
from anyview.surrogate.push import OBJECT_RADIUS, TARGET_HALF, Push
from anyview.trigonometry import unit_vector

Paint = Callable[[np.random.Generator], Colour]

_CONTRAST = 0.35  # that an object has with the table, at least


def sample_object(rng: np.random.Generator, table: Colour) -> list[Shape]:
    """The object in its own frame: most often round and blue."""
    tone = looks.blue(rng) if rng.random() < 0.8 else looks.colour(rng)
    while looks.contrast(tone, table) < _CONTRAST:
        tone = looks.colour(rng)
    look = looks.surface(rng, tone)
    radius, half = OBJECT_RADIUS * rng.uniform(0.82, 1.04), rng.uniform(0.014, 0.046)
    kind = rng.choice(["can", "box", "dome", "capped"], p=[0.6, 0.16, 0.12, 0.12])
    if kind == "box":
        return moved(
            [box((0.8 * radius, 0.8 * radius, half), (0, 0, half), look)], (0, 0, 0), yaw(rng.uniform(0, 1.6))
        )
    if kind == "dome":
        return [ellipsoid((radius, radius, half), (0, 0, half), look)]
    body = [cylinder(radius, half, (0, 0, half), look)]
    if kind == "capped":
        cap = looks.surface(rng, looks.colour(rng), casts_shadow=False)
        body.append(cylinder(radius * rng.uniform(0.2, 0.8), 0.002, (0, 0, 2 * half), cap))
    return body


def sample_target(rng: np.random.Generator, push: Push, table: Colour, object_tone: Colour) -> list[Shape]:
    """The flat target in its place: most often square, and red three times of five."""
    tone = looks.red(rng) if rng.random() < 0.6 else looks.colour(rng)
    while min(looks.contrast(tone, table), looks.contrast(tone, object_tone)) < _CONTRAST:
        tone = looks.colour(rng)
    look = Surface(tone, specular=0.1 * rng.random(), casts_shadow=False)
    half = TARGET_HALF * rng.uniform(0.75, 1.25)
    thick = rng.choice([0.0006, 0.002])
    kind = rng.choice(["square", "oblong", "disc", "framed"], p=[0.62, 0.13, 0.15, 0.10])
    if kind == "disc":
        shapes = [cylinder(half, thick, (0, 0, 0), look)]
    elif kind == "oblong":
        shapes = [box((half * rng.uniform(0.65, 1.0), half * 1.1, thick), (0, 0, 0), look)]
    else:
        shapes = [box((half, half, thick), (0, 0, 0), look)]
    if kind == "framed":
        inside = Surface(looks.colour(rng), casts_shadow=False)
        width = half * rng.uniform(0.4, 0.8)
        shapes.append(box((width, width, thick + 0.0008), (0, 0, 0), inside))
    return moved(shapes, (*push.target_xy, 0.001), yaw(push.target_yaw))


def sample_things(rng: np.random.Generator, push: Push, object_tone: Colour) -> list[Shape]:
    """Other things on the table, none to two dozen of them, out of the way of the push.

    Beside a blue object none of them is blue: nothing else would tell which one will be pushed.
    """
    most = rng.choice([2, 8, 25], p=[0.35, 0.35, 0.30])
    count = int(rng.integers(0, most + 1))
    swept = np.concatenate([push.cup[::20, :2], push.object_xy[::20]])
    discs = [(*push.target_xy, TARGET_HALF * 1.6)]
    paint = _no_blue if looks.is_blue(object_tone) else looks.colour
    palette = [paint(rng) for _ in range(int(rng.integers(1, 9)))]
    shapes: list[Shape] = []
    for _ in range(count):
        tone = palette[rng.integers(len(palette))] if rng.random() < 0.6 else paint(rng)
        thing, radius = _THINGS[rng.integers(len(_THINGS))](rng, looks.surface(rng, tone), paint)
        for _ in range(12):
            x, y = rng.uniform(-0.46, 0.46), rng.uniform(-0.28, 0.40)
            clear = np.hypot(*(swept - (x, y)).T).min() > radius + 0.065
            if clear and all(math.dist((x, y), (a, b)) > radius + r for a, b, r in discs):
                discs.append((x, y, radius))
                shapes += moved(thing, (x, y, 0), yaw(rng.uniform(0, 2 * np.pi)))
                break
    return shapes


def _no_blue(rng: np.random.Generator) -> Colour:
    tone = looks.colour(rng)
    while looks.is_blue(tone):
        tone = looks.colour(rng)
    return tone


def _block(rng: np.random.Generator, look: Surface, paint: Paint) -> tuple[list[Shape], float]:
    x, y, z = rng.uniform(0.015, 0.06), rng.uniform(0.015, 0.05), rng.uniform(0.008, 0.05)
    shapes = [box((x, y, z), (0, 0, z), look)]
    if rng.random() < 0.4:
        lid = looks.surface(rng, paint(rng), casts_shadow=False)
        shapes.append(box((x * 0.9, y * 0.9, 0.003), (0, 0, 2 * z), lid))
    return shapes, math.hypot(x, y)


def _can(rng: np.random.Generator, look: Surface, paint: Paint) -> tuple[list[Shape], float]:
    radius, half = rng.uniform(0.018, 0.05), rng.uniform(0.01, 0.065)
    shapes = [cylinder(radius, half, (0, 0, half), look)]
    if rng.random() < 0.6:
        inside = Surface(paint(rng), casts_shadow=False)
        shapes.append(cylinder(radius * rng.uniform(0.3, 0.9), 0.001, (0, 0, 2 * half), inside))
    if rng.random() < 0.3:
        shapes.append(capsule((radius, 0, half * 0.6), (radius + 0.015, 0, half * 1.4), 0.006, look))
    return shapes, radius + 0.01


def _ball(rng: np.random.Generator, look: Surface, paint: Paint) -> tuple[list[Shape], float]:
    radius, flat = rng.uniform(0.015, 0.04), rng.uniform(0.5, 1.0)
    long = radius * rng.choice([1.0, rng.uniform(1.0, 1.7)])
    return [ellipsoid((long, radius, radius * flat), (0, 0, radius * flat), look)], long


def _stick(rng: np.random.Generator, look: Surface, paint: Paint) -> tuple[list[Shape], float]:
    half, radius = rng.uniform(0.03, 0.10), rng.uniform(0.003, 0.008)
    shapes = [capsule((-half, 0, radius), (half, 0, radius), radius, look)]
    if rng.random() < 0.4:
        tip = looks.surface(rng, paint(rng), casts_shadow=False)
        shapes.append(capsule((half * 0.5, 0, radius), (half, 0, radius), radius * 1.2, tip))
    return shapes, half


def _sheet(rng: np.random.Generator, look: Surface, paint: Paint) -> tuple[list[Shape], float]:
    x, y, z = (
        rng.uniform(0.025, 0.11),
        rng.uniform(0.025, 0.08),
        rng.choice([0.0006, rng.uniform(0.001, 0.014)]),
    )
    shapes = [box((x, y, z), (0, 0, z), look)]
    if rng.random() < 0.5:
        printed = Surface(paint(rng), casts_shadow=False)
        shapes.append(
            box((x * rng.uniform(0.4, 0.95), y * rng.uniform(0.4, 0.95), 0.0006), (0, 0, 2 * z), printed)
        )
    return shapes, math.hypot(x, y)


def _bottle(rng: np.random.Generator, look: Surface, paint: Paint) -> tuple[list[Shape], float]:
    radius, half = rng.uniform(0.018, 0.036), rng.uniform(0.03, 0.075)
    neck = looks.surface(rng, paint(rng))
    return [
        cylinder(radius, half, (0, 0, half), look),
        cylinder(radius * rng.uniform(0.3, 0.6), half * 0.3, (0, 0, 2.3 * half), neck),
    ], radius


def _plate(rng: np.random.Generator, look: Surface, paint: Paint) -> tuple[list[Shape], float]:
    radius, half = rng.uniform(0.04, 0.09), rng.uniform(0.002, 0.012)
    middle = looks.surface(rng, paint(rng), casts_shadow=False)
    return [
        cylinder(radius, half, (0, 0, half), look),
        cylinder(radius * rng.uniform(0.3, 0.9), 0.001, (0, 0, 2 * half), middle),
    ], radius


_THINGS: tuple[Callable[[np.random.Generator, Surface, Paint], tuple[list[Shape], float]], ...] = (
    _block,
    _block,
    _can,
    _can,
    _ball,
    _stick,
    _sheet,
    _bottle,
    _plate,
)


def sample_room(rng: np.random.Generator, table: Colour, behind: Sequence[float]) -> list[Shape]:
    """Table, floor, walls and furniture; furniture stands at azimuths that no camera (``behind``) looks from.

    The pictures of table and floor are in the studio's first two textures.
    """
    white = (1.0, 1.0, 1.0)
    shine = rng.random() ** 2
    top = Surface(white, 0, rng.choice([1.0, 2.0, 3.0]), 0.5 * shine, 0.9 * shine, casts_shadow=False)
    centre, thick = (rng.normal(0.0, 0.05), rng.uniform(-0.02, 0.16)), rng.uniform(0.01, 0.03)
    half = (rng.uniform(0.48, 1.0), rng.uniform(0.42, 0.75) if rng.random() < 0.8 else 1.0)
    shapes = [box((*half, thick), (*centre, -thick), top)]
    if rng.random() < 0.4:
        edge = looks.surface(rng, looks.colour(rng), casts_shadow=False)
        shapes.append(box((half[0] + 0.006, half[1] + 0.006, thick), (*centre, -thick - 0.004), edge))
    floor = Surface(white, 1, rng.uniform(1.0, 10.0), casts_shadow=False)
    shapes.append(box((3.2, 3.2, 0.05), (0, 0, -rng.uniform(0.5, 0.85)), floor))
    for angle in (0.0, 0.5, 1.0, 1.5):
        x, y = unit_vector(np.pi * angle) * rng.uniform(2.9, 3.1)
        wall = Surface(looks.table_colour(rng), 1 if rng.random() < 0.3 else None, 2.0, casts_shadow=False)
        shapes.append(box((0.05, 3.2, 2.0), (x, y, 0.8), wall, yaw(np.pi * angle)))
    for _ in range(int(rng.integers(0, 8))):
        angle, distance = rng.uniform(0, 2 * np.pi), rng.uniform(1.3, 2.6)
        if all(math.cos(angle - azimuth) < 0.3 for azimuth in behind):
            x, y = unit_vector(angle) * distance
            size = (rng.uniform(0.1, 0.5), rng.uniform(0.1, 0.6), rng.uniform(0.2, 1.0))
            look = looks.surface(rng, looks.colour(rng), casts_shadow=False)
            shapes.append(box(size, (x, y, -0.7 + size[2]), look, yaw(angle)))
    return shapes
