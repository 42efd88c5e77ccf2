"""Reading one raw clip: even frames out of whatever a camera left, or the reason why not."""

from collections.abc import Iterator
from pathlib import Path
from time import monotonic

import cv2
import numpy as np

from anyview.config import Ingest
from anyview.ingest.containers import MAX_PIXELS, Damaged, check_container
from anyview.runtime.errors import AnyviewError
from anyview.video.files import open_capture
from anyview.video.manifests import read_table, times_file

LONGEST = 1.5  # a raw clip may be this many times as long as a finished one
MAX_RATE = 250.0  # frames a second
LARGEST_SIDECAR = 2**20  # bytes, tens of thousands of times
PATIENCE = 120.0  # seconds of decoding, a hundred times what a clip takes
LONGEST_GAP = 2.5  # output periods without a source frame
MAX_REPEATS = 0.1  # of a clip's frames may show their predecessor again: the camera was a little slow
MAX_STILL = 0.5  # of a clip's frames may be their predecessor's copy: somebody pauses
STILL_SECONDS = 2.0  # longer without a single changed pixel: the camera hung
MIN_MOTION = 1.0  # grey levels, the mean over a picture, between the first frame and the most different one
MIN_CONTRAST = 4.0  # grey levels, standard deviation within a picture
MIN_COLOUR = 16.0  # between a pixel's channels, at the most colourful hundredth of a clip


class Refused(Exception):
    """Why a clip cannot be used, in words for its owner."""


def read_clip(path: Path, limits: Ingest) -> np.ndarray:
    """The finished frames, uint8 RGB (frames, size, size, 3), of a raw clip; raises ``Refused``.

    Output frame k is the first unused source frame within a source period of k / rate; where the camera left
    a gap, the frame before the gap stands again.
    """
    try:
        shown = check_container(path)
        frames = _decode(path, _sidecar_times(path), shown, limits)
    except Damaged as damage:
        raise Refused(f"damaged: {damage}") from None
    except AnyviewError as error:
        raise Refused(str(error).removeprefix(f"{path}: ")) from None
    except cv2.error:
        raise Refused("damaged: a frame cannot be decoded") from None
    _check_content(frames, limits.rate)
    return frames


def _sidecar_times(path: Path) -> np.ndarray | None:
    """Seconds of every frame, where a sidecar states them."""
    sidecar = path.with_name(times_file(path.name))
    if not sidecar.is_file():
        return None
    if sidecar.stat().st_size > LARGEST_SIDECAR:
        raise Refused(f"{sidecar.name}: too large for a clip's times")
    try:
        times = read_table(sidecar, ["seconds"])["seconds"].to_numpy(float)
    except (AnyviewError, ValueError, OverflowError):
        raise Refused(f"{sidecar.name}: not a table of seconds") from None
    if len(times) < 2 or not np.isfinite(times).all() or (np.diff(times) <= 0).any():
        raise Refused(f"{sidecar.name}: the times do not increase")
    return times


def _decode(
    path: Path, sidecar: np.ndarray | None, shown: float, limits: Ingest, measured: float | None = None
) -> np.ndarray:
    """Even frames; ``measured`` is the clip's rate where its container states none."""
    frames = np.empty((limits.frames, limits.size, limits.size, 3), np.uint8)
    filled = used = decoded = 0
    time = 0.0
    with open_capture(path) as (capture, messages):
        _check_picture_size(capture)
        stated = capture.get(cv2.CAP_PROP_FPS)
        if measured is None and not 0 < stated <= MAX_RATE:  # FFmpeg says how fast its clock ticks instead
            times = np.fromiter(_grab_all(capture, sidecar, limits), float)
            measured = (len(times) - 1) / times[-1] if len(times) > 1 and times[-1] > 0 else MAX_RATE
            return _decode(path, sidecar, shown, limits, measured)
        rate = measured or stated
        period = min(1 / rate if sidecar is None else float(np.median(np.diff(sidecar))), 1 / limits.rate)
        for time in _grab_all(capture, sidecar, limits):
            decoded += 1
            while 0 < filled < limits.frames and time > filled / limits.rate + period:
                frames[filled] = frames[filled - 1]
                filled += 1
            if filled < limits.frames and time >= filled / limits.rate - 0.75 * period:
                frames[filled] = _shrink(capture.retrieve()[1], limits.size)
                filled, used = filled + 1, used + 1
        declared = shown * capture.get(cv2.CAP_PROP_FRAME_COUNT)
        if measured and stated > 0:  # a count of ticks: the duration times that rate
            declared *= measured / stated
        damage = messages.damage()
    if not decoded:
        raise Refused(f"damaged, or of a codec that is unknown here: {damage or 'no frame can be decoded'}")
    if damage or decoded < max(declared - max(2.0, 0.02 * declared), 1):
        raise Refused(f"damaged: {damage or f'{decoded} of {declared:.0f} frames can be decoded'}")
    if filled < limits.frames:
        raise Refused(f"{time + period:.2f} s long, {limits.frames / limits.rate:g} s are needed")
    if used < (1 - MAX_REPEATS) * limits.frames:
        raise Refused(f"slower than {limits.rate:g} frames a second")
    return frames


def _check_picture_size(capture: cv2.VideoCapture) -> None:
    width = int(capture.get(cv2.CAP_PROP_FRAME_WIDTH))
    height = int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
    if width < 1 or height < 1 or width * height > MAX_PIXELS:
        raise Refused(f"a picture of {width} x {height}")


def _grab_all(capture: cv2.VideoCapture, sidecar: np.ndarray | None, limits: Ingest) -> Iterator[float]:
    """Grab frame after frame and yield its time: seconds by the sidecar, else from the first frame."""
    longest = LONGEST * limits.frames / limits.rate
    deadline = monotonic() + PATIENCE
    start = last = step = 0.0
    decoded = 0
    while capture.grab():
        if sidecar is not None and decoded == len(sidecar):
            raise Refused(f"its sidecar lists {decoded} frames, the clip has more")
        time = capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3 if sidecar is None else float(sidecar[decoded])
        if sidecar is None and decoded == 0:
            start = time
        elif sidecar is None and time == 0:  # not known: the last frame of an MPEG program stream
            time = start + last + step
        time -= start
        if time < last and decoded:
            raise Refused("its frames' times run backwards")
        if time - last > LONGEST_GAP / limits.rate:
            raise Refused(f"no frame between {last:.2f} s and {time:.2f} s")
        if time > longest or decoded > longest * MAX_RATE:
            raise Refused(f"longer than {longest:g} s")
        if monotonic() > deadline:
            raise Refused(f"takes more than {PATIENCE:g} s to decode")
        yield time
        decoded, last, step = decoded + 1, time, time - last
    if sidecar is not None and decoded != len(sidecar):
        raise Refused(f"its sidecar lists {len(sidecar)} frames, the clip has {decoded}")


def _shrink(picture: np.ndarray, size: int) -> np.ndarray:
    """The middle square of a BGR picture, averaged down to RGB (size, size, 3)."""
    height, width = picture.shape[:2]
    side = min(height, width)
    top, left = (height - side) // 2, (width - side) // 2
    square = picture[top : top + side, left : left + side]
    small = cv2.resize(square, (size, size), interpolation=cv2.INTER_AREA)
    return cv2.cvtColor(small, cv2.COLOR_BGR2RGB)


def _check_content(frames: np.ndarray, rate: float) -> None:
    """Refuse pictures that show nothing, no colour or no motion."""
    red, green, blue = (frames[..., channel] for channel in range(3))
    grey = (red.astype(np.float32) + green + blue) / 3
    if (grey.std(axis=(1, 2)) < MIN_CONTRAST).mean() > 0.05:
        raise Refused("black or of one colour")
    spread = np.maximum(np.maximum(red, green), blue) - np.minimum(np.minimum(red, green), blue)
    if np.percentile(spread, 99) < MIN_COLOUR:
        raise Refused("without colour")
    if np.abs(grey - grey[0]).mean(axis=(1, 2)).max() < MIN_MOTION:
        raise Refused("nothing moves")
    changes = (frames[1:] != frames[:-1]).any(axis=(1, 2, 3))
    if changes.mean() < 1 - MAX_STILL:
        raise Refused(f"frozen: {len(changes) - changes.sum()} of {len(frames)} frames repeat the one before")
    longest = still = 0
    for changed in changes:
        still = 0 if changed else still + 1
        longest = max(longest, still)
    if longest > STILL_SECONDS * rate:
        raise Refused(f"frozen for {longest / rate:.1f} s")
