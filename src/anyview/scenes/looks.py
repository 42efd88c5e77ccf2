"""Random colours, surfaces and textures."""

import colorsys

import cv2
import numpy as np

from anyview.scenes.shapes import Colour, Surface
from anyview.scenes.studio import TEXTURE_SIZE

_TEXTURES = {"paint": 0.3, "wood": 0.32, "planks": 0.1, "stone": 0.14, "stripes": 0.07, "checks": 0.07}


def colour(rng: np.random.Generator) -> Colour:
    """Any colour: half of them vivid, the others muted or grey."""
    kind = rng.random()
    if kind < 0.5:
        return hsv(rng.random(), rng.uniform(0.55, 1.0), rng.uniform(0.3, 1.0))
    if kind < 0.75:
        return hsv(rng.random(), rng.uniform(0.1, 0.55), rng.uniform(0.2, 0.95))
    return hsv(rng.random(), rng.uniform(0.0, 0.1), rng.uniform(0.05, 1.0))


def hsv(hue: float, saturation: float, value: float) -> Colour:
    """RGB of a hue (1 is once around), a saturation and a value."""
    return colorsys.hsv_to_rgb(hue % 1.0, saturation, value)


def blue(rng: np.random.Generator) -> Colour:
    """The colour that the task's object has most often."""
    return hsv(rng.uniform(0.56, 0.68), rng.uniform(0.65, 1.0), rng.uniform(0.35, 1.0))


def is_blue(tone: Colour) -> bool:
    """Whether ``tone`` could be taken for the object's colour, see ``blue``."""
    hue, saturation, value = colorsys.rgb_to_hsv(*tone)
    return 0.5 < hue < 0.74 and saturation > 0.45 and value > 0.2


def red(rng: np.random.Generator) -> Colour:
    """The colour that the task's target has most often."""
    return hsv(rng.uniform(-0.04, 0.04), rng.uniform(0.65, 1.0), rng.uniform(0.5, 1.0))


def table_colour(rng: np.random.Generator) -> Colour:
    """Wood of any tone, white or grey, dark, or painted."""
    kind = rng.random()
    if kind < 0.4:
        return hsv(rng.uniform(0.04, 0.14), rng.uniform(0.15, 0.65), rng.uniform(0.35, 0.95))
    if kind < 0.7:
        return hsv(rng.random(), rng.uniform(0.0, 0.08), rng.uniform(0.45, 0.98))
    if kind < 0.8:
        return hsv(rng.random(), rng.uniform(0.0, 0.4), rng.uniform(0.08, 0.35))
    return hsv(rng.random(), rng.uniform(0.05, 0.55), rng.uniform(0.3, 0.9))


def skin(rng: np.random.Generator) -> Colour:
    """Between the palest skin and the darkest."""
    depth = rng.random()
    return hsv(rng.uniform(0.035, 0.075), 0.28 + 0.3 * depth + rng.uniform(-0.06, 0.06), 0.95 - 0.65 * depth)


def contrast(first: Colour, second: Colour) -> float:
    """Distance of two colours, 0 to 1 and a half."""
    return float(np.sqrt(sum((a - b) ** 2 for a, b in zip(first, second, strict=True))))


def surface(rng: np.random.Generator, tone: Colour, casts_shadow: bool = True) -> Surface:
    """A surface of one colour, dull or shiny."""
    shine = rng.random() ** 2
    shininess = 0.1 + 0.8 * rng.random() * shine
    return Surface(tone, specular=0.5 * shine, shininess=shininess, casts_shadow=casts_shadow)


def texture(rng: np.random.Generator, tone: Colour) -> np.ndarray:
    """A picture, uint8 (256, 256, 3), of wood, cloth, stone, planks or plain paint around ``tone``."""
    kind = rng.choice(list(_TEXTURES), p=list(_TEXTURES.values()))
    strength = rng.uniform(0.02, 0.16)
    speckle = rng.standard_normal((TEXTURE_SIZE, TEXTURE_SIZE), np.float32) * rng.uniform(0.0, 0.06)
    pattern = np.zeros_like(speckle)
    if kind in ("wood", "planks"):
        pattern += 0.7 * _noise(rng, int(rng.integers(40, 160)), int(rng.integers(2, 5)))
        pattern += 0.6 * _noise(rng, int(rng.integers(6, 16)), 3)
    if kind == "planks":
        boards = rng.normal(0.0, 1.0, int(rng.integers(4, 10))).astype(np.float32)
        pattern += cv2.resize(boards[:, None], (TEXTURE_SIZE, TEXTURE_SIZE), interpolation=cv2.INTER_NEAREST)
    if kind == "stone":
        for cells in (5, 17, 60):
            pattern += 0.6 * _noise(rng, cells, cells)
    if kind in ("stripes", "checks"):
        bands = np.arange(TEXTURE_SIZE) * int(rng.integers(6, 24)) // TEXTURE_SIZE % 2
        waves = (2 * bands - 1).astype(np.float32)
        pattern += waves[:, None]
        if kind == "checks":
            pattern += waves
    if rng.random() < 0.5:
        pattern = pattern.T
    picture = np.array(tone, np.float32) * (1.0 + strength * pattern + speckle)[..., None]
    if kind in ("stripes", "checks", "stone") and rng.random() < 0.5:  # of two colours
        mix = np.clip(0.5 + 0.5 * pattern, 0.0, 1.0)[..., None]
        picture += mix * (np.array(colour(rng), np.float32) - picture)
    return (np.clip(picture, 0.0, 1.0) * 255).astype(np.uint8)


def _noise(rng: np.random.Generator, rows: int, columns: int) -> np.ndarray:
    """Smooth noise of about unit size with so many hills down and across, float32 (256, 256)."""
    hills = rng.standard_normal((rows, columns), np.float32)
    return cv2.resize(hills, (TEXTURE_SIZE, TEXTURE_SIZE), interpolation=cv2.INTER_CUBIC)
