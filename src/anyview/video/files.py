"""Whole video files of our own: frames are uint8 RGB arrays (T, H, W, 3).

FFV1 in AVI is lossless and keeps simulated frames; XVID, 4 times smaller, keeps real clips; AV1 in MP4 is
what other programs show. All give the same bytes for any number of cores.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from fractions import Fraction
from pathlib import Path
from typing import Literal

import av
import numpy as np
from av.video.frame import VideoFrame

from anyview.runtime.errors import AnyviewError
from anyview.video.reading import open_video

Codec = Literal["FFV1", "XVID", "AV1"]
os.environ.setdefault("SVT_LOG", "1")  # errors: the encoder of AV1 tells its whole configuration

# XVID: of constant quality, a key frame every 12 frames. AV1: a key frame every 2 frames, as LeRobot has it.
_ENCODERS: dict[Codec, tuple[Literal["ffv1", "mpeg4", "libsvtav1"], str, dict[str, str]]] = {
    "FFV1": ("ffv1", "bgr0", {"flags": "+bitexact"}),
    "XVID": ("mpeg4", "yuv420p", {"flags": "+bitexact+qscale", "qmin": "3", "g": "12"}),
    "AV1": ("libsvtav1", "yuv420p", {"crf": "20", "preset": "8", "g": "2", "svtav1-params": "lp=1"}),
}


def video_frames(path: Path) -> Iterator[np.ndarray]:
    """The frames of a video one by one, uint8 RGB (H, W, 3).

    Raises AnyviewError if the file is missing, cannot be opened, or is damaged.
    """
    with open_video(path) as video:
        for frame in video.frames():
            yield video.rgb(frame)


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
            raise ValueError(f"{size[0]}x{size[1]} frames: only even sizes can be written")
        self._path, self._size = path, size
        self._partial = path.with_name(f".{path.stem}.partial{path.suffix}")
        name, pixels, options = _ENCODERS[codec]
        try:
            self._container = av.open(
                str(self._partial.resolve()), "w", container_options={"fflags": "+bitexact"}
            )
        except OSError as error:
            raise AnyviewError(f"{path}: cannot be written: {error.strerror}") from None
        self._stream = self._container.add_stream(name, Fraction(fps).limit_denominator(1001), options)
        self._stream.width, self._stream.height = size
        self._stream.pix_fmt = pixels
        self._stream.codec_context.thread_count = 1
        if path.suffix == ".avi":
            self._stream.codec_context.codec_tag = codec

    def write(self, frame: np.ndarray) -> None:
        """Append a frame, uint8 RGB (H, W, 3)."""
        width, height = self._size
        if frame.shape != (height, width, 3) or frame.dtype != np.uint8:
            raise ValueError(f"frame {frame.dtype} {frame.shape}, not uint8 {(height, width, 3)}")
        self._mux(VideoFrame.from_ndarray(frame, "rgb24"))

    def _mux(self, frame: VideoFrame | None) -> None:
        with self._told():
            self._container.mux(self._stream.encode(frame))

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Tell of a failed write as of bad input."""
        try:
            yield
        except OSError as error:
            raise AnyviewError(f"{self._path}: {error.strerror}; disk full?") from None

    def __enter__(self) -> "VideoWriter":
        return self

    def __exit__(self, kind: type[BaseException] | None, *details: object) -> None:
        try:
            if kind is None:
                self._mux(None)
                with self._told():
                    self._container.close()
                os.replace(self._partial, self._path)
        finally:
            with suppress(OSError):
                self._container.close()
            self._partial.unlink(missing_ok=True)


def write_video(path: Path, frames: np.ndarray, fps: float, codec: Codec = "FFV1") -> None:
    """Write ``frames``, uint8 RGB (T, H, W, 3), whole or not at all. FFV1 is lossless."""
    with VideoWriter(path, (frames.shape[2], frames.shape[1]), fps, codec) as video:
        for frame in frames:
            video.write(frame)
