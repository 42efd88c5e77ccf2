"""Cameras of every kind: where they stand, how their lens bends, what sensor and firmware make of it."""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from anyview.scenes.studio import Camera
from anyview.trigonometry import unit_vector

_BORDER = 0.94  # of the way from the picture's centre to its edge: what matters is nearer than that


@dataclass(frozen=True)
class Lens:
    """Radial distortion: what is seen at radius r was drawn at r (1 + k r^2) / (1 + 2 k).

    The radius is 1 in the middle of an edge. Barrel where ``k`` is positive. Corners stay where they are, so
    that the drawn picture covers the seen one.
    """

    k: float

    def drawn(self, seen: np.ndarray) -> np.ndarray:
        """Where in the drawn picture points (..., 2) of the seen one come from, both -1 to 1."""
        return seen * (1.0 + self.k * (seen**2).sum(axis=-1, keepdims=True)) / (1.0 + 2.0 * self.k)

    def seen(self, drawn: np.ndarray) -> np.ndarray:
        """Where points (N, 2) of the drawn picture are seen: the inverse of ``drawn``, by fixed points."""
        points = drawn
        for _ in range(12):
            points = drawn * (1.0 + 2.0 * self.k) / (1.0 + self.k * (points**2).sum(axis=-1, keepdims=True))
        return points


@dataclass(frozen=True)
class View:
    """A camera in its place, with its lens."""

    azimuth: float  # radians
    camera: Camera
    lens: Lens


def sample_view(rng: np.random.Generator, points: np.ndarray, arm: float, left: bool) -> View | None:
    """A view of ``points`` (N, 3), all inside the picture; None if there is no luck.

    Nobody films from where the arm, at azimuth ``arm`` in the end, hides the target. Cameras stand on the
    operator's left or right, now and then anywhere.
    """
    for _ in range(60):
        azimuth = np.radians(rng.uniform(80, 235) if left else rng.uniform(-55, 100))
        if rng.random() < 0.15:
            azimuth = np.radians(rng.uniform(-60, 240))
        if math.cos(azimuth - arm) > 0.6:
            continue
        elevation = np.radians(rng.uniform(*((30, 62), (16, 89))[int(rng.random() < 0.4)]))
        roll = np.radians(rng.normal(0.0, 2.0) if rng.random() < 0.7 else rng.uniform(-18, 18))
        field, span = rng.uniform(0.4, 1.15), rng.uniform(0.5, 1.0)
        aim = np.array([rng.normal(0.0, 0.03), rng.normal(0.02, 0.04), 0.02])
        aim += rng.uniform(0.0, 0.8) * (points.mean(axis=0) - aim)
        camera = place_camera(azimuth, elevation, roll, field, aim, 0.5 * span / math.tan(0.5 * field))
        lens = Lens(rng.choice([0.0, rng.uniform(-0.03, 0.16)]))
        if np.abs(lens.seen(camera.project(points))).max() < _BORDER:
            return View(azimuth, camera, lens)
    return None


def place_camera(
    azimuth: float, elevation: float, roll: float, field: float, aim: np.ndarray, distance: float
) -> Camera:
    """A camera that looks at ``aim`` (3,) from a place given by angles in radians and metres."""
    east, north = unit_vector(azimuth)
    level, rise = unit_vector(elevation)
    back = np.array([level * east, level * north, rise])
    right = np.array([-north, east, 0.0])
    cosine, sine = unit_vector(roll)
    up = cosine * np.cross(back, right) - sine * right
    return Camera(aim + distance * back, -back, up, field)


class Sensor:
    """One camera's pictures: softness, resolution, compression, light falling off, noise, tone, sharpening.

    Exposure is set by the first picture, as a camera would, and then stays but for a per cent or so: that is
    what ingest leaves of a real one's.
    """

    def __init__(self, rng: np.random.Generator, lens: Lens, drawn: int, size: int):
        """``drawn`` and ``size`` are the pixels along a side of what comes in and what goes out."""
        self._rng, self._size = rng, size
        grid = (np.arange(drawn) + 0.5) * (2.0 / drawn) - 1.0
        source = lens.drawn(np.stack(np.meshgrid(grid, grid), axis=-1))
        self._bends = lens.k != 0.0
        source = ((source + 1.0) * (0.5 * drawn) - 0.5).astype(np.float32)
        self._map_x, self._map_y = np.ascontiguousarray(source[..., 0]), np.ascontiguousarray(source[..., 1])
        unit = drawn / size  # drawn pixels in one of the finished picture
        self._softness = unit * 0.55 * rng.random() ** 3
        self._resolution = drawn if rng.random() < 0.5 else int(rng.uniform(1.3, unit) * size)
        self._quality = int(rng.integers(25, 95)) if rng.random() < 0.3 else None
        edge = np.linspace(-1.0, 1.0, size)
        falloff = 1.0 - rng.uniform(0.0, 0.3) * rng.random() * (edge[:, None] ** 2 + edge**2) / 2
        white = np.array([math.exp(gain) for gain in rng.normal(0.0, (0.08, 0.02, 0.08))])
        self._light = (falloff[..., None] * white).astype(np.float32)
        self._brightness = rng.uniform(85.0, 195.0)  # that the first picture gets on average
        self._gain: float | None = None
        self._wander = rng.uniform(0.0, 0.02)
        self._noise = 3.0 * rng.random() ** 2
        self._grain = rng.uniform(0.0, 0.6)
        self._tone = _tone_curve(rng)
        self._sharpening = rng.uniform(0.0, 0.7) if rng.random() < 0.35 else 0.0

    def expose(self, picture: np.ndarray) -> np.ndarray:
        """The finished frame, uint8 (size, size, 3), of a drawn ``picture``, both uint8 RGB and square."""
        if self._bends:
            picture = cv2.remap(
                picture, self._map_x, self._map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
            )
        if self._softness > 0.25:
            picture = cv2.GaussianBlur(picture, (0, 0), self._softness)
        if self._resolution < len(picture):
            picture = cv2.resize(picture, (self._resolution,) * 2, interpolation=cv2.INTER_AREA)
        if self._quality is not None:
            picture = _compressed(picture, self._quality)
        small = cv2.resize(picture, (self._size,) * 2, interpolation=cv2.INTER_AREA)
        if self._gain is None:
            self._gain = min(max(self._brightness / max(float(small.mean()), 1.0), 0.6), 2.5)
        wander = math.exp(self._rng.normal(0.0, self._wander)) * self._gain
        light = small * self._light
        light *= np.float32(wander)
        noise = self._rng.standard_normal(light.shape, np.float32)
        noise += np.float32(self._grain) * self._rng.standard_normal((*light.shape[:2], 1), np.float32)
        light += noise * (np.float32(self._noise) * (np.float32(0.5) + light * np.float32(1 / 255)))
        frame = cv2.LUT(np.clip(light, 0.0, 255.0, out=light).astype(np.uint8), self._tone)
        if self._sharpening:
            soft = cv2.GaussianBlur(frame, (0, 0), 0.8)
            frame = cv2.addWeighted(frame, 1.0 + self._sharpening, soft, -self._sharpening, 0.0)
        return frame


def _compressed(picture: np.ndarray, quality: int) -> np.ndarray:
    """What JPEG leaves of a picture."""
    bgr = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)
    jpeg = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    return cv2.cvtColor(cv2.imdecode(jpeg, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)  # type: ignore[arg-type]


def _tone_curve(rng: np.random.Generator) -> np.ndarray:
    """Any contrast from flat to hard, (256,) uint8."""
    gamma, hardness = rng.uniform(0.65, 1.15), rng.uniform(-0.15, 0.5)
    black, white = rng.uniform(0.0, 0.10), rng.uniform(0.92, 1.0)
    curve = np.array([(level / 255) ** gamma for level in range(256)])
    curve += hardness * (curve * curve * (3.0 - 2.0 * curve) - curve)
    return (np.clip(black + (white - black) * curve, 0.0, 1.0) * 255).astype(np.uint8)
