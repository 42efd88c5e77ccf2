"""Video files in and out: frames are uint8 RGB arrays (T, H, W, 3).

FFV1 in AVI is lossless and keeps simulated frames; XVID, 4 times smaller, keeps real clips. The stock OpenCV
wheel encodes and decodes both, with the same bytes for any number of cores.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

import cv2
import numpy as np

from anyview.runtime.errors import AnyviewError
from anyview.video.ffmpeg import Messages, listening

Codec = Literal["FFV1", "XVID"]


@contextmanager
def open_capture(path: Path) -> Iterator[tuple[cv2.VideoCapture, Messages]]:
    """Open a video file for reading on one thread; yields it with FFmpeg's messages about it.

    Raises AnyviewError naming the file when there is none or it cannot be opened.
    """
    if not path.is_file():
        raise AnyviewError(f"{path}: no such file")
    with listening() as messages:
        # An absolute path cannot be taken for a protocol ("concat:...") or for a device.
        capture = cv2.VideoCapture(str(path.resolve()), cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, 1])
        try:
            if not capture.isOpened():
                raise AnyviewError(f"{path}: not a video that can be opened")
            yield capture, messages
        finally:
            capture.release()


def video_frames(path: Path) -> Iterator[np.ndarray]:
    """The frames of a video one by one, uint8 RGB (H, W, 3).

    Raises AnyviewError when the file is missing, cannot be opened, or at its end turns out to be damaged: it
    holds another number of frames than its header declares, or FFmpeg found fault with one.
    """
    count = 0
    with open_capture(path) as (capture, messages):
        declared = int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
        while (frame := capture.read()[1]) is not None:
            count += 1
            yield cv2.cvtColor(frame, cv2.COLOR_BGR2RGB)
        damage = messages.damage()
    if not count or count != declared:
        raise AnyviewError(f"{path}: damaged: {count} of {declared} frames can be decoded")
    if damage:
        raise AnyviewError(f"{path}: damaged: {damage}")


def read_video(path: Path) -> np.ndarray:
    """All frames of a video, uint8 RGB (T, H, W, 3); raises like ``video_frames``."""
    return np.stack(list(video_frames(path)))


class VideoWriter:
    """Write frames one by one; the file appears under its name only when it is whole.

    >>> with VideoWriter(Path("clip.avi"), (640, 360), fps=30.0, codec="XVID") as video:
    ...     video.write(frame)  # uint8 RGB (360, 640, 3)
    """

    def __init__(self, path: Path, size: tuple[int, int], fps: float, codec: Codec):
        if size[0] % 2 or size[1] % 2:
            raise ValueError(f"{size[0]}x{size[1]} frames: OpenCV writes even sizes only")
        self._path, self._size = path, size
        self._partial = path.with_name(f".{path.stem}.partial{path.suffix}")
        self._written = 0
        fourcc = cv2.VideoWriter.fourcc(*codec)
        with listening():
            self._writer = cv2.VideoWriter(str(self._partial.resolve()), cv2.CAP_FFMPEG, fourcc, fps, size)
        if not self._writer.isOpened():
            self._partial.unlink(missing_ok=True)
            raise AnyviewError(f"{path}: cannot write {codec} video here; is the folder there and writable?")

    def write(self, frame: np.ndarray) -> None:
        """Append a frame, uint8 RGB (H, W, 3)."""
        width, height = self._size
        if frame.shape != (height, width, 3) or frame.dtype != np.uint8:
            raise ValueError(f"frame {frame.dtype} {frame.shape}, not uint8 {(height, width, 3)}")
        self._writer.write(cv2.cvtColor(frame, cv2.COLOR_RGB2BGR))
        self._written += 1

    def __enter__(self) -> "VideoWriter":
        return self

    def __exit__(self, kind: type[BaseException] | None, *details: object) -> None:
        with listening():
            self._writer.release()
        try:
            if kind is None:
                # OpenCV reports no failed write, so that a full disk shows only in what can be read back.
                with open_capture(self._partial) as (capture, _):
                    stored = int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
                if stored != self._written or _lacks_bytes(self._partial):
                    raise AnyviewError(f"{self._path}: {self._written} frames were not stored; disk full?")
                os.replace(self._partial, self._path)
        finally:
            self._partial.unlink(missing_ok=True)


def _lacks_bytes(path: Path) -> bool:
    """Whether an AVI is shorter than its header says: FFmpeg takes half a write for a whole one."""
    with path.open("rb") as file:
        start = file.read(8)
    return start[:4] == b"RIFF" and path.stat().st_size < 8 + int.from_bytes(start[4:], "little")


def write_video(path: Path, frames: np.ndarray, fps: float, codec: Codec = "FFV1") -> None:
    """Write ``frames``, uint8 RGB (T, H, W, 3), whole or not at all. FFV1 is lossless."""
    with VideoWriter(path, (frames.shape[2], frames.shape[1]), fps, codec) as video:
        for frame in frames:
            video.write(frame)
