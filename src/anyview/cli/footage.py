"""A user's own footage as input of a translator: the middle square, shrunk to the model's size."""

from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from anyview import paths
from anyview.runtime.errors import AnyviewError
from anyview.video.manifests import read_table
from anyview.video.reading import PICTURES, VIDEOS, open_video
from anyview.video.sets import read_stored

_LONGEST = 20_000  # frames: a third of an hour at 15 frames a second


class StoredClip(NamedTuple):
    """A clip of one of the pipeline's sets; ``choice`` is what its expert chose, where there was a choice."""

    dataset: str
    choice: str | None


def find_clip(clip: str) -> StoredClip | None:
    """Where the clip of this name is stored, or None if ``clip`` is a file.

    Raises AnyviewError if it is neither.
    """
    if Path(clip).exists():
        return None
    folder = paths.DATA / "clips"
    for manifest in sorted(folder.glob("*/manifest.csv")):
        rows = read_table(manifest, ["clip"], unique="clip")
        for row in rows[rows["clip"] == clip].to_dict("records"):
            return StoredClip(manifest.parent.name, row.get("choice"))
    raise AnyviewError(f"{clip}: no such file, and no clip of a set in {folder}")


def read_clip(clip: str, size: int, most: int = _LONGEST) -> tuple[np.ndarray, float]:
    """Frames, uint8 RGB (T, size, size, 3), and frames per second of a video, or of a clip of a set.

    Raises AnyviewError naming the file if it is missing, no video, damaged, or longer than ``most`` frames;
    or if the clip of a set is of another size.
    """
    if (stored := find_clip(clip)) is not None:
        frames, rate = read_stored(paths.clip_set(stored.dataset), clip)
        if frames.shape[1] != size:
            raise AnyviewError(f"{clip}: frames of {frames.shape[1]} pixels, but the translator's are {size}")
        return frames, rate
    with open_video(Path(clip)) as video:
        squares = [video.square(frame, size) for frame in islice(video.frames(), most + 1)]
    if len(squares) > most:
        raise AnyviewError(f"{clip}: longer than {most} frames; cut it to the demonstration")
    return np.stack(squares), video.rate


def read_view(path: Path, size: int) -> np.ndarray:
    """A picture, or the first frame of a video, as uint8 RGB (size, size, 3).

    Raises AnyviewError naming the file if it is missing, neither of them, or damaged.
    """
    with open_video(path, f"{PICTURES},{VIDEOS}") as video:
        return video.square(next(video.frames()), size)
