"""A user's own footage as input of a translator: the middle square, shrunk to the model's size."""

from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np

from anyview.ingest.containers import Damaged, check_container
from anyview.runtime.errors import AnyviewError
from anyview.video.ffmpeg import listening
from anyview.video.files import open_capture

_LONGEST = 20_000  # frames: a third of an hour at 15 frames a second
_DEFAULT_RATE = 10.0  # where the file states none


def read_clip(path: Path, size: int, most: int = _LONGEST) -> tuple[np.ndarray, float]:
    """Frames, uint8 RGB (T, size, size, 3), and frames per second of a video.

    Raises AnyviewError naming the file when it is missing, no video, damaged, or longer than ``most`` frames.
    """
    frames, rate = _read(path, size, most + 1)
    if len(frames) > most:
        raise AnyviewError(f"{path}: longer than {most} frames; cut it to the demonstration")
    return frames, rate


def read_view(path: Path, size: int) -> np.ndarray:
    """A picture, or the first frame of a video, as uint8 RGB (size, size, 3)."""
    if not path.is_file():
        raise AnyviewError(f"{path}: no such file")
    content, picture = np.fromfile(path, np.uint8), None
    with listening() as messages:
        with suppress(cv2.error):  # told below, like every picture that does not open
            picture = cv2.imdecode(content, cv2.IMREAD_COLOR) if len(content) else None
        damage = messages.damage()
    if damage or (picture is None and cv2.haveImageReader(str(path))):
        raise AnyviewError(f"{path}: damaged: {damage or 'not a whole picture, or one too large to open'}")
    return _read(path, size, 1)[0][0] if picture is None else _square(picture, size)


def _read(path: Path, size: int, most: int) -> tuple[np.ndarray, float]:
    with open_capture(path) as (capture, messages):
        try:
            check_container(path)
        except Damaged as found:
            raise AnyviewError(f"{path}: damaged: {found}") from None
        rate = capture.get(cv2.CAP_PROP_FPS)
        frames: list[np.ndarray] = []
        while len(frames) < most and (frame := capture.read()[1]) is not None:
            frames.append(_square(frame, size))
        damage = messages.damage()
    if damage or not frames:
        raise AnyviewError(f"{path}: damaged: {damage or 'no frame can be decoded'}")
    return np.stack(frames), rate if 1 <= rate <= 1000 else _DEFAULT_RATE


def _square(picture: np.ndarray, size: int) -> np.ndarray:
    height, width = picture.shape[:2]
    side = min(height, width)
    top, left = (height - side) // 2, (width - side) // 2
    middle = picture[top : top + side, left : left + side]
    return cv2.cvtColor(cv2.resize(middle, (size, size), interpolation=cv2.INTER_AREA), cv2.COLOR_BGR2RGB)
