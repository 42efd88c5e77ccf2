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


def clip_table(splits: list[str], pairs: list[str] | None = None) -> pd.DataFrame:
    """A manifest with one clip for each of ``splits``."""
    names = [f"clip-{n:03d}" for n in range(len(splits))]
    return pd.DataFrame({"clip": names, "pair": pairs or names, "split": splits})
