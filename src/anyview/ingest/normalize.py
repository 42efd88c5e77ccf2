"""Reading one raw clip: even frames out of whatever a camera left, or the reason why not."""

from collections.abc import Iterator
from pathlib import Path
from time import monotonic
from typing import NamedTuple

import cv2
import numpy as np

from anyview.config import Ingest
from anyview.ingest.exposure import even_exposure
from anyview.runtime.errors import AnyviewError
from anyview.video.manifests import read_table, times_file
from anyview.video.reading import MAX_RATE, Frame, Video, open_video

LONGEST = 1.5  # a raw clip without a stretch may be this many times as long as a finished one
SHORTEST_STRETCH, LONGEST_STRETCH = 1.0, 300.0  # seconds
LARGEST_SIDECAR = 2**20  # bytes, tens of thousands of times
PATIENCE = 120.0  # seconds of decoding, a hundred times what a clip takes
CLOCKS_AGREE = 0.001  # seconds; the end of a stretch is rounded, and so are the times of frames
LONGEST_GAP = 2.5  # output periods without a source frame
MAX_REPEATS = 0.1  # of a clip's frames may show their predecessor again: the camera was a little slow
MAX_STILL = 0.5  # of a clip's frames may be their predecessor's copy: somebody pauses
STILL_SECONDS = 2.0  # longer without a single changed pixel: the camera hung
MIN_MOTION = 1.0  # grey levels, the mean over a picture, between the first frame and the most different one
MIN_CONTRAST = 4.0  # grey levels, standard deviation within a picture
MIN_COLOUR = 16.0  # between a pixel's channels, at the most colourful hundredth of a clip


class Refused(Exception):
    """Why a clip cannot be used, in words for its owner."""


class Stretch(NamedTuple):
    """The part of a raw clip that shows the demonstration, in seconds after its first frame."""

    start: float
    end: float


def parse_stretch(start: str, end: str) -> Stretch | None:
    """The stretch that a row of a manifest asks for, None if both are empty; raises ``Refused``."""
    if not (start or end):
        return None
    given = f"start {start or 'empty'}, end {end or 'empty'}"
    try:
        stretch = Stretch(float(start), float(end))
    except ValueError:
        raise Refused(f"{given}: two numbers of seconds are needed, or none") from None
    if not 0 <= stretch.start < stretch.end < np.inf:
        raise Refused(f"{given}: the stretch must begin at 0 s or later and end after that")
    if not SHORTEST_STRETCH <= stretch.end - stretch.start <= LONGEST_STRETCH:
        raise Refused(f"{given}: it must last {SHORTEST_STRETCH:g} to {LONGEST_STRETCH:g} s")
    return stretch


def read_clip(path: Path, limits: Ingest, stretch: Stretch | None = None) -> np.ndarray:
    """The finished frames, uint8 RGB (frames, size, size, 3), of a raw clip; raises ``Refused``.

    Output frame k shows the time start + k (end - start) / frames of the stretch, so that demonstrations of
    any length are paired by progress. Without a stretch, the first frames / rate seconds are taken. Each
    output frame is the first unused source frame within a source period of its time. Where the camera left a
    gap, or is slower than the output, the frame before stands again.
    """
    try:
        frames, fresh = _resample(path, sidecar_times(path), stretch, limits)
    except AnyviewError as error:
        raise Refused(str(error).removeprefix(f"{path}: ")) from None
    except cv2.error:
        raise Refused("damaged: a frame cannot be decoded") from None
    seconds = stretch.end - stretch.start if stretch else limits.frames / limits.rate
    _check_content(frames[fresh], fresh.sum() / seconds)
    return even_exposure(frames) if limits.even_exposure else frames


def sidecar_times(path: Path) -> np.ndarray | None:
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


def _resample(
    path: Path, sidecar: np.ndarray | None, stretch: Stretch | None, limits: Ingest
) -> tuple[np.ndarray, np.ndarray]:
    """Even frames, and which of them, bool (frames,), do not repeat the one before."""
    start, end = stretch or Stretch(0.0, limits.frames / limits.rate)
    moments, spacing = np.linspace(start, end, limits.frames, endpoint=False, retstep=True)
    frames = np.empty((limits.frames, limits.size, limits.size, 3), np.uint8)
    fresh = np.zeros(limits.frames, bool)
    filled, last = 0, 0.0
    with open_video(path) as video:
        source = 1 / video.rate if sidecar is None else float(np.median(np.diff(sidecar)))
        tolerance = min(source, spacing)
        longest = np.inf if stretch else LONGEST * end
        for time, frame in timed_frames(video, sidecar, start, longest):
            previous, last = max(last, start), time
            if time - previous > LONGEST_GAP / limits.rate:
                raise Refused(f"no frame between {previous:.2f} s and {time:.2f} s")
            if stretch and time > end - CLOCKS_AGREE:  # it may show the beginning of another demonstration
                break
            while 0 < filled < limits.frames and time > moments[filled] + tolerance:
                frames[filled] = frames[filled - 1]
                filled += 1
            if filled < limits.frames and time >= moments[filled] - 0.75 * tolerance:
                frames[filled] = video.square(frame, limits.size)
                fresh[filled] = True
                filled += 1
            if stretch and filled == limits.frames:
                break
    while 0 < filled < limits.frames and moments[filled] + spacing <= last + 1.25 * source:
        frames[filled] = frames[filled - 1]
        filled += 1
    if filled < limits.frames:
        wanted = f"its stretch ends at {end:g} s" if stretch else f"{end:g} s are needed"
        raise Refused(f"{last + source:.2f} s long, {wanted}")
    if fresh.sum() < (1 - MAX_REPEATS) * min(limits.frames, limits.rate * (end - start)):
        raise Refused(f"slower than {limits.rate:g} frames a second")
    return frames, fresh


def timed_frames(
    video: Video, sidecar: np.ndarray | None, begin: float = 0.0, longest: float = np.inf
) -> Iterator[tuple[float, Frame]]:
    """Frame after frame with its time: seconds by the sidecar, else after the first frame.

    Before ``begin`` frames may be missing. Raises ``Refused`` if the times make no film, or last longer than
    ``longest``.
    """
    deadline = monotonic() + PATIENCE
    last = -np.inf
    decoded = 0
    for frame in video.frames(begin if sidecar is None else 0.0):
        if sidecar is not None and decoded == len(sidecar):
            raise Refused(f"its sidecar lists {decoded} frames, the clip has more")
        time = frame.time if sidecar is None else float(sidecar[decoded])
        if time < last:
            raise Refused("its frames' times run backwards")
        if time > longest or decoded > longest * MAX_RATE:
            raise Refused(f"longer than {longest:g} s")
        if monotonic() > deadline:
            raise Refused(f"takes more than {PATIENCE:g} s to decode")
        yield time, frame
        decoded, last = decoded + 1, time
    if sidecar is not None and decoded != len(sidecar):
        raise Refused(f"its sidecar lists {len(sidecar)} frames, the clip has {decoded}")


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
