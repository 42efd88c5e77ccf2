"""Still pictures: PNG files, and contact sheets that show a set of clips at a glance."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from anyview.runtime.outputs import write_atomically

_LABEL = 14  # pixels for the label below a clip
_GAP = 6


def write_png(path: Path, picture: np.ndarray) -> None:
    """Write a picture, uint8 RGB (H, W, 3)."""
    write_atomically(path, cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))[1].tobytes())


def contact_sheet(
    clips: Sequence[np.ndarray], labels: Sequence[str], moments: int = 5, columns: int = 3
) -> np.ndarray:
    """A picture (H, W, 3) with ``moments`` frames of every clip (T, h, w, 3), uint8 RGB, over its label."""
    cells = [_cell(clip, label, moments) for clip, label in zip(clips, labels, strict=True)]
    blank = np.full_like(cells[0], 255)
    cells += [blank] * (-len(cells) % columns)
    rows = [np.concatenate(cells[i : i + columns], axis=1) for i in range(0, len(cells), columns)]
    return np.concatenate(rows)


def _cell(clip: np.ndarray, label: str, moments: int) -> np.ndarray:
    chosen = np.linspace(0, len(clip) - 1, moments).round().astype(int)
    strip = np.concatenate(list(clip[chosen]), axis=1)
    height, width = strip.shape[:2]
    cell = np.full((height + _LABEL + _GAP, width + _GAP, 3), 255, np.uint8)
    cell[:height, :width] = strip
    place = (2, height + _LABEL - 4)
    return cv2.putText(cell, label, place, cv2.FONT_HERSHEY_SIMPLEX, 0.32, (30, 30, 30), 1, cv2.LINE_AA)


def resize(frames: np.ndarray, size: int) -> np.ndarray:
    """Square uint8 ``frames`` (..., H, H, 3) with sides of ``size`` pixels; unchanged if they have these."""
    if frames.shape[-2] == size:
        return frames
    flat = frames.reshape(-1, *frames.shape[-3:])
    resized = np.stack([cv2.resize(frame, (size, size), interpolation=cv2.INTER_LINEAR) for frame in flat])
    return resized.reshape(*frames.shape[:-3], size, size, 3)
