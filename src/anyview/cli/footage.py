"""A user's own footage as input of a translator: the middle square, shrunk to the model's size."""

from itertools import islice
from pathlib import Path

import numpy as np

from anyview.runtime.errors import AnyviewError
from anyview.video.reading import PICTURES, VIDEOS, open_video

_LONGEST = 20_000  # frames: a third of an hour at 15 frames a second


def read_clip(path: Path, size: int, most: int = _LONGEST) -> tuple[np.ndarray, float]:
    """Frames, uint8 RGB (T, size, size, 3), and frames per second of a video.

    Raises AnyviewError naming the file if it is missing, no video, damaged, or longer than ``most`` frames.
    """
    with open_video(path) as video:
        frames = [video.square(frame, size) for frame in islice(video.frames(), most + 1)]
    if len(frames) > most:
        raise AnyviewError(f"{path}: longer than {most} frames; cut it to the demonstration")
    return np.stack(frames), video.rate


def read_view(path: Path, size: int) -> np.ndarray:
    """A picture, or the first frame of a video, as uint8 RGB (size, size, 3).

    Raises AnyviewError naming the file if it is missing, neither of them, or damaged.
    """
    with open_video(path, f"{PICTURES},{VIDEOS}") as video:
        return video.square(next(video.frames()), size)
