"""A cheap webcam: what its lens, sensor, firmware and clock do to a clean rendered picture."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np

from anyview.trigonometry import unit_vector

_NOISE_MARGIN = 64


@dataclass(frozen=True)
class Lens:
    """A wide lens with barrel distortion (Brown 1971), for pictures of ``size`` (width, height)."""

    size: tuple[int, int]
    fovy: float  # radians, vertical, of the finished picture
    k1: float
    k2: float

    def undistorted(self) -> tuple[np.ndarray, float]:
        """Where each pixel looks, (H, W, 2) tangents of a pinhole camera, and the fovy to cover them."""
        width, height = self.size
        focal = 0.5 * height / math.tan(0.5 * self.fovy)
        centre = (0.5 * (width - 1), 0.5 * (height - 1))
        camera = np.array([[focal, 0, centre[0]], [0, focal, centre[1]], [0, 0, 1]])
        grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 1, 2)
        brown = np.array([self.k1, self.k2, 0.0, 0.0])
        until = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-7)
        rays = cv2.undistortPoints(grid.astype(np.float64), camera, brown, criteria=until)
        rays = rays.reshape(height, width, 2)
        reach = max(np.abs(rays[..., 1]).max(), np.abs(rays[..., 0]).max() * height / width)
        return rays, 2 * math.atan(reach)


class Webcam:
    """One webcam during one recording: pictures come in rendered and go out as the camera delivers them.

    Lens distortion, soft focus, vignetting, exposure that settles and drifts, white balance that wanders,
    mains flicker, shot noise and sharpening. Give it pictures in the order of time.
    """

    def __init__(self, lens: Lens, rendered: tuple[int, int], rng: np.random.Generator):
        """``rendered`` is (width, height) of the pictures that come in, at the lens's rendering fovy."""
        width, height = lens.size
        rays, fovy = lens.undistorted()
        focal = 0.5 * rendered[1] / math.tan(0.5 * fovy)
        self._map_x = (rays[..., 0] * focal + 0.5 * (rendered[0] - 1)).astype(np.float32)
        self._map_y = (rays[..., 1] * focal + 0.5 * (rendered[1] - 1)).astype(np.float32)
        self._rng = rng
        falloff = 1.0 - 0.22 * ((rays**2).sum(axis=-1) / (rays**2).sum(axis=-1).max())
        self._vignette = np.repeat(falloff[..., None], 3, axis=2).astype(np.float32)
        self._white = _exponential(rng.normal(0.0, (0.05, 0.015, 0.05)))
        self._brightness = rng.uniform(0.96, 1.12)
        self._tone = _tone_curve(rng)
        shape = (height + _NOISE_MARGIN, width + _NOISE_MARGIN, 3)
        self._noise = _sensor_noise(rng, shape)
        self._sigma = (rng.uniform(2.0, 3.2) * np.sqrt(0.25 + np.arange(256) / 128.0)).astype(np.float32)
        self._softness = rng.uniform(0.65, 0.9)  # pixels
        self._settling = rng.normal(0.0, 0.10)
        self._drift = np.zeros(3)  # log gain of exposure, red and blue: Ornstein-Uhlenbeck processes
        self._time = 0.0
        self._flicker = rng.uniform(0.004, 0.014)
        self._rows = np.arange(height) / height * rng.uniform(0.8, 2.0)

    def expose(self, picture: np.ndarray, time: float) -> np.ndarray:
        """The frame (H, W, 3) delivered for a rendered ``picture`` at ``time`` (seconds), both uint8 RGB."""
        focused = cv2.GaussianBlur(picture, (3, 3), self._softness)
        frame = cv2.remap(
            focused, self._map_x, self._map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        light: np.ndarray = cv2.multiply(frame, self._vignette, dtype=cv2.CV_32F)
        light *= self._gains(time)
        x, y = self._rng.integers(0, _NOISE_MARGIN, 2)
        noise = self._noise[y : y + light.shape[0], x : x + light.shape[1]]
        if self._rng.random() < 0.5:
            noise = noise[:, ::-1]
        shot: np.ndarray = cv2.LUT(frame, self._sigma)
        shot *= noise
        light += shot
        sensed = cv2.LUT(np.clip(light, 0.0, 255.0, out=light).astype(np.uint8), self._tone)
        soft = cv2.GaussianBlur(sensed, (0, 0), 1.2)
        return cv2.addWeighted(sensed, 1.25, soft, -0.25, 0.0)

    def _gains(self, time: float) -> np.ndarray:
        """(H, 1, 3) float32: exposure, white balance and a flicker band that travels down the picture."""
        elapsed, self._time = time - self._time, time
        keep = math.exp(-elapsed / 2.5)
        spread = np.array([0.035, 0.012, 0.012]) * math.sqrt(1.0 - keep**2)
        self._drift = keep * self._drift + spread * self._rng.normal(size=3)
        exposure, red, blue = self._drift
        exposure += self._settling * math.exp(-time / 0.7)
        gains = _exponential([exposure + red, exposure, exposure + blue])
        wave = unit_vector(2 * np.pi * (self._rows + 0.37 * time))[..., 1]
        band = 1.0 + self._flicker * wave
        return (band[:, None, None] * (self._brightness * self._white * gains)).astype(np.float32)


def _exponential(values: Iterable[float]) -> np.ndarray:
    """e to the power of each of a few values, by the C library: numpy's last bit depends on the processor."""
    return np.array([math.exp(value) for value in values])


def frame_times(rng: np.random.Generator, duration: float) -> np.ndarray:
    """Seconds at which frames arrive: about 10.6 a second, uneven, with a hiccup now and then."""
    rate = rng.uniform(10.3, 11.0)
    gaps = (1.0 + rng.normal(0.0, 0.08, int(duration * rate * 1.5))) / rate
    gaps += np.where(rng.random(len(gaps)) < 0.012, rng.uniform(0.04, 0.11, len(gaps)), 0.0)
    gaps[0] = rng.uniform(0.0, 0.05)
    times = np.cumsum(np.maximum(gaps, 0.02))
    return times[times < duration]


def _tone_curve(rng: np.random.Generator) -> np.ndarray:
    """The firmware's contrast: a gentle S over a lifted black, (256,) uint8."""
    x = np.linspace(0.0, 1.0, 256)
    gamma = rng.uniform(0.78, 0.92)
    curve = np.array([level**gamma for level in x.tolist()])
    curve += rng.uniform(0.02, 0.06) * unit_vector(2 * np.pi * (curve - 0.5))[..., 1] * 0.8
    return (np.clip(0.02 + 0.98 * curve, 0.0, 1.0) * 255).astype(np.uint8)


def _sensor_noise(rng: np.random.Generator, shape: tuple[int, int, int]) -> np.ndarray:
    """Unit noise as it leaves demosaicing: mostly luminance grain, with softer blotches of colour."""
    height, width, _ = shape
    grain = cv2.GaussianBlur(rng.standard_normal((height, width), dtype=np.float32), (0, 0), 0.6)
    blotches = cv2.GaussianBlur(rng.standard_normal(shape, dtype=np.float32), (0, 0), 1.6)
    return 0.8 * (grain / grain.std())[..., None] + 0.6 * blotches / blotches.std()
