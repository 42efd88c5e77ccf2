"""Clips of a disc that moves to a goal, each on its own ground: what a translator needs, in 16x16 pixels."""

import numpy as np
import pandas as pd

SIZE, LENGTH = 16, 12


def disc_clips(count: int, size: int = SIZE, length: int = LENGTH, seed: int = 0) -> np.ndarray:
    """Clips (count, length, size, size, 3): a bright disc moves evenly from its start to a red square."""
    rng = np.random.default_rng(seed)
    rows, columns = np.mgrid[:size, :size]
    clips = np.empty((count, length, size, size, 3), np.uint8)
    for clip in clips:
        clip[:] = rng.integers(60, 120, 3)
        start, goal = rng.uniform(0.2 * size, 0.8 * size, (2, 2))
        clip[:, (abs(rows - goal[0]) < 2) & (abs(columns - goal[1]) < 2)] = (220, 30, 30)
        for t, frame in enumerate(clip):
            y, x = start + (goal - start) * t / (length - 1)
            frame[(rows - y) ** 2 + (columns - x) ** 2 < (0.18 * size) ** 2] = (40, 60, 230)
    return clips


def disc_marks(count: int, size: int = SIZE, length: int = LENGTH, seed: int = 0) -> np.ndarray:
    """Where disc and square are in ``disc_clips``: x and y in pixels, float32 (count, length, 2, 2)."""
    rng = np.random.default_rng(seed)
    marks = np.empty((count, length, 2, 2), np.float32)
    for mark in marks:
        rng.integers(60, 120, 3)
        start, goal = rng.uniform(0.2 * size, 0.8 * size, (2, 2))
        mark[:, 0] = (start + (goal - start) * np.linspace(0, 1, length)[:, None])[:, ::-1]
        mark[:, 1] = goal[::-1]
    return marks


def clip_table(splits: list[str], pairs: list[str] | None = None) -> pd.DataFrame:
    """A manifest with one clip for each of ``splits``."""
    names = [f"clip-{n:03d}" for n in range(len(splits))]
    return pd.DataFrame({"clip": names, "pair": pairs or names, "split": splits})
