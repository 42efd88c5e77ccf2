"""Procedural textures of the rig: woods, carpet, plaster, a window."""

from functools import cache

import cv2
import numpy as np

from anyview.seeds import stream

TABLES = ("beech", "laminate", "oak")
_REPEATS = {"beech": 1, "oak": 1, "laminate": 2, "carpet": 8, "plaster": 3, "rod": 1, "window": 1}


def materials_xml() -> str:
    """MJCF assets: a texture and a material of the same name for each."""
    return "".join(
        f'<texture name="{name}" type="2d" file="{name}.png"/>' + _material(name, repeat)
        for name, repeat in _REPEATS.items()
    )


def _material(name: str, repeat: int) -> str:
    shine = 'specular="0.3" shininess="0.4"' if name in TABLES else 'specular="0.05" shininess="0.1"'
    glow = ' emission="0.7"' if name == "window" else ""
    return f'<material name="{name}" texture="{name}" texrepeat="{repeat} {repeat}" {shine}{glow}/>'


@cache
def texture_files() -> dict[str, bytes]:
    """Procedural textures as PNG files, the same on every machine."""
    rng = stream(0, "textures")
    pictures = {
        "beech": _wood(rng, (0.80, 0.67, 0.49), 0.07),
        "oak": _wood(rng, (0.62, 0.47, 0.31), 0.10),
        "laminate": _grain(rng, (0.78, 0.78, 0.76), 0.025, 1.0),
        "carpet": _grain(rng, (0.33, 0.35, 0.38), 0.10, 0.8),
        "plaster": _grain(rng, (0.76, 0.75, 0.70), 0.02, 3.0),
        "rod": _wood(rng, (0.72, 0.56, 0.36), 0.05),
        "window": _window(),
    }
    files = {}
    for name, picture in pictures.items():
        pixels = (np.clip(picture, 0.0, 1.0) * 255).astype(np.uint8)
        files[f"{name}.png"] = cv2.imencode(".png", cv2.cvtColor(pixels, cv2.COLOR_RGB2BGR))[1].tobytes()
    return files


def _wood(rng: np.random.Generator, colour: tuple[float, float, float], contrast: float) -> np.ndarray:
    """Grain: noise drawn out along x, with broad bands."""
    fine = cv2.GaussianBlur(rng.normal(size=(512, 512)), (0, 0), sigmaX=40, sigmaY=0.8)
    broad = cv2.GaussianBlur(rng.normal(size=(512, 512)), (0, 0), sigmaX=120, sigmaY=9)
    pattern = 0.5 * fine / fine.std() + 0.7 * broad / broad.std()
    return np.array(colour) * (1.0 + contrast * pattern[..., None])


def _grain(
    rng: np.random.Generator, colour: tuple[float, float, float], contrast: float, size: float
) -> np.ndarray:
    noise = cv2.GaussianBlur(rng.normal(size=(256, 256)), (0, 0), size)
    return np.array(colour) * (1.0 + contrast * noise[..., None] / noise.std())


def _window() -> np.ndarray:
    """A bright pane with a cross bar and the sky paler towards the bottom."""
    rows = np.linspace(0.0, 1.0, 128)[:, None, None]
    picture = np.array([0.80, 0.88, 0.98]) * (1 - rows) + np.array([0.97, 0.97, 0.95]) * rows
    picture = np.repeat(picture, 128, axis=1)
    picture[60:68] = picture[:, 60:68] = 0.55
    return picture
