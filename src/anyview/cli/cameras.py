"""Filming a demonstration with one or more cameras at once."""

import math
import threading
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, closing
from itertools import count
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from anyview.ingest.raw_manifest import read_raw_manifest
from anyview.runtime.errors import AnyviewError
from anyview.runtime.outputs import write_atomically
from anyview.video.files import VideoWriter
from anyview.video.manifests import KINDS, RAW_COLUMNS, times_file
from anyview.video.reading import open_video

RATE = 10.0  # frames a second that are kept
PATIENCE = 2.0  # seconds without a frame before a camera counts as unplugged
_WISHED_SIZE = (1280, 720)


def _device_number(name: str, source: str) -> int | None:
    """The number of a camera device; None where ``source`` is a file."""
    if not (source.isascii() and source.isdigit()):
        return None
    if len(source) > 4:
        raise AnyviewError(f"camera {name}: {source}: no such device; on Linux /dev/video2 is number 2")
    return int(source)


class Camera:
    """A camera device (``"0"``) or a video file that stands for one; its newest frame is always at hand.

    A file shows its first frame until ``roll`` and then plays at its own pace, to its end.
    """

    def __init__(self, name: str, source: str):
        """Raises AnyviewError when the source cannot be opened or gives no frame."""
        self.name, self.source = name, source
        self._rolling = threading.Event()
        self._stopping = threading.Event()
        self._changed = threading.Condition()
        self._ended = False
        self._damage: AnyviewError | None = None
        device = _device_number(name, source)
        self._is_file = device is None
        self._pictures = _filmed(device) if device is not None else self._played(Path(source))
        picture = next(self._pictures, None)
        if picture is None:
            raise AnyviewError(f"camera {name}: {source} gives no picture; is it plugged in and free?")
        self._newest = (picture, time.monotonic())
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def newest(self) -> tuple[np.ndarray, float]:
        """The newest frame, uint8 RGB with even sides, and the ``time.monotonic`` at which it came."""
        picture, taken = self._newest
        height, width = picture.shape[:2]
        return picture[: height // 2 * 2, : width // 2 * 2], taken

    def wait(self, after: float) -> None:
        """Wait for a frame newer than ``after``; raises AnyviewError when none comes."""
        with self._changed:
            self._changed.wait_for(lambda: self._newest[1] > after or self._ended, PATIENCE)
        if self._damage is not None:
            raise self._damage
        if self._newest[1] <= after:
            reason = "the file ends too early" if self._is_file else "no frame comes; was it unplugged?"
            raise AnyviewError(f"camera {self.name}: {reason}")

    def roll(self) -> None:
        """Let a video file play."""
        self._rolling.set()

    def close(self) -> None:
        """Free the device."""
        self._stopping.set()
        self._rolling.set()
        self._thread.join()

    def _watch(self) -> None:
        try:
            with closing(self._pictures):
                for picture in self._pictures:
                    if self._stopping.is_set():
                        return
                    with self._changed:
                        self._newest = (picture, time.monotonic())
                        self._changed.notify_all()
        except AnyviewError as damage:  # a video that cannot be decoded to its end
            self._damage = damage
        finally:
            with self._changed:
                self._ended = True
                self._changed.notify_all()

    def _played(self, path: Path) -> Generator[np.ndarray, None, None]:
        """The pictures of a file, the first one again at ``roll`` and each later one when it is due."""
        with open_video(path) as video:
            began = 0.0
            for frame in video.frames():
                picture = video.rgb(frame)
                if not began:
                    yield picture
                    self._rolling.wait()
                    began = time.monotonic()
                self._stopping.wait(max(began + frame.time - time.monotonic(), 0.0))
                yield picture


def _filmed(device: int) -> Generator[np.ndarray, None, None]:
    """The pictures of a camera device as they come."""
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # warnings would spoil the display
    capture = cv2.VideoCapture(device)
    # Compressed pictures, so that two cameras fit on one USB bus.
    capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG"))
    capture.set(cv2.CAP_PROP_FRAME_WIDTH, _WISHED_SIZE[0])
    capture.set(cv2.CAP_PROP_FRAME_HEIGHT, _WISHED_SIZE[1])
    try:
        while (picture := capture.read()[1]) is not None:
            yield cv2.cvtColor(picture, cv2.COLOR_BGR2RGB)
    finally:
        capture.release()


def free_pair(folder: Path) -> str:
    """An id that no clip of the folder has, listed in its manifest or not: ``demo-001`` and so on."""
    taken = set(_manifest(folder)["pair"])
    pairs = (f"demo-{number:03d}" for number in count(1))
    return next(pair for pair in pairs if pair not in taken and not any(folder.glob(f"{pair}-*")))


def check_place(folder: Path, pair: str, kind: str, names: Sequence[str]) -> None:
    """Raise AnyviewError when a recording of this name cannot go into ``folder``."""
    if kind not in KINDS:
        raise AnyviewError(f"kind {kind}: must be one of {', '.join(KINDS)}")
    for name in (pair, *names):
        if not name or not all(letter.isalnum() or letter in "-_" for letter in name):
            raise AnyviewError(f"{name!r}: a name has only letters, digits, - and _")
    if len(set(names)) < len(names):
        raise AnyviewError(f"cameras {', '.join(names)}: give each another name")
    if pair in set(_manifest(folder)["pair"]):
        raise AnyviewError(f"{folder / 'manifest.csv'}: pair {pair} is there already; choose another --pair")
    for name in names:
        if (path := folder / f"{pair}-{name}.avi").exists():
            raise AnyviewError(f"{path}: exists, but not in the manifest; delete it or choose another --pair")


def film(
    cameras: Sequence[Camera],
    folder: Path,
    pair: str,
    kind: str,
    seconds: float,
    advance: Callable[[], object],
) -> list[Path]:
    """Film ``seconds`` with every camera at ``RATE``, add the clips to the folder's manifest and return them.

    Each clip gets a sidecar with its frames' times, on one clock for all cameras. ``advance`` is called for
    each of ``ticks(seconds)``. On any error, Ctrl-C included, manifest and folder stay as they were.
    """
    paths = [folder / f"{pair}-{camera.name}.avi" for camera in cameras]
    times: list[list[float]] = [[] for _ in cameras]
    try:
        with ExitStack() as stack:
            writers = []
            for camera, path in zip(cameras, paths, strict=True):
                height, width = camera.newest()[0].shape[:2]
                writers.append(stack.enter_context(VideoWriter(path, (width, height), RATE, "XVID")))
            ready = time.monotonic()
            for camera in cameras:
                camera.roll()
                camera.wait(ready)
            began = max(camera.newest()[1] for camera in cameras)
            for tick in range(ticks(seconds)):
                # In the middle of its period, so that a camera of the same rate gives a new frame each time.
                time.sleep(max(began + (tick + 0.5) / RATE - time.monotonic(), 0.0))
                for camera, writer, stamps in zip(cameras, writers, times, strict=True):
                    picture, taken = camera.newest()
                    if stamps and taken <= began + stamps[-1]:
                        camera.wait(began + stamps[-1])
                        picture, taken = camera.newest()
                    writer.write(picture)
                    stamps.append(taken - began)
                advance()
        for camera, path, stamps in zip(cameras, paths, times, strict=True):
            _check_pace(camera, stamps)
            table = pd.DataFrame({"seconds": np.round(stamps, 4)})
            write_atomically(path.with_name(times_file(path.name)), table.to_csv(index=False))
        rows = [(path.name, pair, camera.name, kind) for camera, path in zip(cameras, paths, strict=True)]
        manifest = pd.concat([_manifest(folder), pd.DataFrame(rows, columns=list(RAW_COLUMNS))])
        write_atomically(folder / "manifest.csv", manifest.to_csv(index=False))
    except BaseException:
        for path in paths:
            path.unlink(missing_ok=True)
            path.with_name(times_file(path.name)).unlink(missing_ok=True)
        raise
    return paths


def ticks(seconds: float) -> int:
    """Frames that a recording of ``seconds`` keeps of each camera."""
    return math.ceil(seconds * RATE)


def _check_pace(camera: Camera, stamps: list[float]) -> None:
    rate = (len(stamps) - 1) / (stamps[-1] - stamps[0])
    if rate < 0.9 * RATE:
        raise AnyviewError(
            f"camera {camera.name}: {rate:.1f} frames a second, {RATE:g} are needed; give it more light, "
            "a USB port of its own or a smaller picture"
        )


def _manifest(folder: Path) -> pd.DataFrame:
    path = folder / "manifest.csv"
    return read_raw_manifest(path) if path.exists() else pd.DataFrame(columns=list(RAW_COLUMNS))
