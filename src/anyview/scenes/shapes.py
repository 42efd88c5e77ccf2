"""Solid shapes with surfaces, and groups of them that move as one."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from anyview.trigonometry import unit_vector

Colour = tuple[float, float, float]  # RGB, 0 to 1
Vector = Sequence[float] | np.ndarray  # (3,), metres
UPRIGHT = np.eye(3)


@dataclass(frozen=True)
class Surface:
    """What a shape looks like; ``texture`` is a slot of the studio, whose picture is multiplied by colour."""

    colour: Colour
    texture: int | None = None
    repeats: float = 1.0  # of the texture along a side
    specular: float = 0.1
    shininess: float = 0.2
    casts_shadow: bool = True


@dataclass(frozen=True)
class Shape:
    """A solid: ``size`` as MuJoCo has it, three half lengths or a radius and a half length along z."""

    kind: Literal["BOX", "CAPSULE", "CYLINDER", "ELLIPSOID"]
    size: tuple[float, float, float]
    surface: Surface
    position: np.ndarray  # (3,) metres
    turn: np.ndarray  # (3, 3) rotation


def box(half: Vector, at: Vector, surface: Surface, turn: np.ndarray = UPRIGHT) -> Shape:
    x, y, z = half
    return Shape("BOX", (x, y, z), surface, np.array(at, float), turn)


def cylinder(radius: float, half: float, at: Vector, surface: Surface) -> Shape:
    return Shape("CYLINDER", (radius, half, 0.0), surface, np.array(at, float), UPRIGHT)


def ellipsoid(half: Vector, at: Vector, surface: Surface) -> Shape:
    x, y, z = half
    return Shape("ELLIPSOID", (x, y, z), surface, np.array(at, float), UPRIGHT)


def capsule(begin: Vector, end: Vector, radius: float, surface: Surface) -> Shape:
    """A capsule whose round ends have their centres at ``begin`` and ``end``."""
    first, last = np.array(begin, float), np.array(end, float)
    half = 0.5 * float(np.sqrt(((last - first) ** 2).sum()))
    return Shape("CAPSULE", (radius, half, 0.0), surface, 0.5 * (first + last), z_along(last - first))


def moved(shapes: Iterable[Shape], position: Vector, turn: np.ndarray) -> list[Shape]:
    """The shapes of one body, turned about its origin and put at ``position``."""
    return [
        replace(
            shape, position=np.asarray(position) + apply(turn, shape.position), turn=compose(turn, shape.turn)
        )
        for shape in shapes
    ]


def yaw(angle: float) -> np.ndarray:
    """The rotation about z, (3, 3)."""
    cosine, sine = unit_vector(angle)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def pitch(angle: float) -> np.ndarray:
    """The rotation about y, (3, 3): z leans towards x."""
    cosine, sine = unit_vector(angle)
    return np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])


def z_along(direction: np.ndarray) -> np.ndarray:
    """A rotation (3, 3) that takes z to ``direction`` (3,), which need not be of unit length."""
    z = direction / np.sqrt((direction**2).sum())
    x = np.cross((0.0, 1.0, 0.0) if abs(z[1]) < 0.9 else (1.0, 0.0, 0.0), z)
    x /= np.sqrt((x**2).sum())
    return np.stack([x, np.cross(z, x), z], axis=1)


def apply(turn: np.ndarray, point: np.ndarray) -> np.ndarray:
    """``turn @ point`` without BLAS, whose last bits depend on the processor."""
    return (turn * point).sum(axis=-1)


def compose(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """``first @ second`` without BLAS."""
    return (first[:, :, None] * second).sum(axis=1)
