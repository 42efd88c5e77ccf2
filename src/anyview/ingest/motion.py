"""Where in a raw clip the demonstration is: from its first motion to its last, in both views of a pair."""

from pathlib import Path

import cv2
import numpy as np
import pandas as pd
from scipy.ndimage import median_filter

from anyview.ingest.normalize import SHORTEST_STRETCH, Refused, Stretch, sidecar_times, timed_frames
from anyview.runtime.errors import AnyviewError
from anyview.runtime.workers import run_tasks
from anyview.video.manifests import STRETCH_COLUMNS
from anyview.video.reading import open_video

RATE = 10.0  # pictures a second that are compared
_SIZE = 48
_MOVING = 0.02  # of a picture's pixels, those that change most, tell how much moves: an arm is small
_WINDOW = 5  # pictures, half a second: a lamp that is switched on is no motion
_THRESHOLD = 0.2  # of the way from a clip's calmest moment to its liveliest
_LEAST = 2.0  # grey levels between these two
_MARGIN = 0.3  # seconds kept before and after
_LARGEST_OFFSET = 30.0  # seconds between the starts of two cameras


def motion(path: Path) -> np.ndarray:
    """How much moves in a raw clip at each tenth of a second, grey levels (T,).

    Raises AnyviewError or ``Refused`` if the clip cannot be read.
    """
    changes: list[float] = []
    before: np.ndarray | None = None
    with open_video(path) as video:
        for time, frame in timed_frames(video, sidecar_times(path)):
            if time < len(changes) / RATE:
                continue
            picture = cv2.GaussianBlur(video.square(frame, _SIZE), (0, 0), 1.0).astype(np.float32)
            change = np.abs(picture - (picture if before is None else before)).mean(axis=2).ravel()
            few = int(_MOVING * change.size)
            changes += [float(np.partition(change, -few)[-few:].mean())] * (
                int(time * RATE) + 1 - len(changes)
            )
            before = picture
    return np.array(changes)


def moving_stretch(changes: np.ndarray) -> Stretch | None:
    """The stretch in which something moves, by ``motion``; None if it is too short for a demonstration."""
    smooth = median_filter(changes, _WINDOW, mode="nearest")
    low, high = np.quantile(smooth, 0.05), smooth.max()
    if low > high / 2:  # there is no calm moment
        low = 0.0
    if high - low < _LEAST:
        return None
    moving = np.flatnonzero(smooth > low + _THRESHOLD * (high - low))
    start = max(moving[0] / RATE - _MARGIN, 0.0)
    end = min((moving[-1] + 1) / RATE + _MARGIN, len(changes) / RATE)
    return Stretch(start, end) if end - start >= SHORTEST_STRETCH else None


def offset(first: np.ndarray, second: np.ndarray) -> float:
    """Seconds from the start of ``first`` to the start of ``second``: where their motions agree best."""
    a, b = (changes - changes.mean() for changes in (first, second))
    agreement = np.correlate(a, b, mode="full")
    shifts = np.arange(len(agreement)) - (len(b) - 1)
    agreement[np.abs(shifts) > _LARGEST_OFFSET * RATE] = -np.inf
    return float(shifts[agreement.argmax()]) / RATE


def stretches_of_pair(motions: list[np.ndarray]) -> list[Stretch | None]:
    """The stretch of each view of a demonstration, of one length: views show the same at the same time.

    The views' motions are added up on the clock of the first. A stretch reaches no further than the view that
    began last and the one that ended first.
    """
    offsets = [0.0, *(offset(motions[0], other) for other in motions[1:])]
    begin = max(offsets)
    end = min(shift + len(changes) / RATE for shift, changes in zip(offsets, motions, strict=True))
    count = round((end - begin) * RATE)
    if count < 1:
        return [None] * len(motions)
    firsts = [round((begin - shift) * RATE) for shift in offsets]
    together = sum(changes[first : first + count] for first, changes in zip(firsts, motions, strict=True))
    found = moving_stretch(np.asarray(together))
    if found is None:
        return [None] * len(motions)
    return [Stretch(found.start + first / RATE, found.end + first / RATE) for first in firsts]


def propose_stretches(folder: Path, manifest: pd.DataFrame) -> tuple[pd.DataFrame, dict[str, str]]:
    """A raw manifest with ``start`` and ``end`` where both were empty, and why some files still have none."""
    columns = [column for column in manifest.columns if column not in STRETCH_COLUMNS]
    table = manifest.reindex(columns=[*columns, *STRETCH_COLUMNS], fill_value="")
    empty = table[(table["start"] == "") & (table["end"] == "")]
    tasks = [(folder / file,) for file in empty["file"]]
    motions = dict(zip(empty["file"], run_tasks(_motion_or_reason, tasks), strict=True))
    reasons = {file: found for file, found in motions.items() if isinstance(found, str)}
    readable = empty[~empty["file"].isin(reasons)]
    demonstration = readable["pair"].where(readable["pair"] != "", readable["file"])
    for _, views in readable.groupby(demonstration, sort=False):
        found = stretches_of_pair([motions[file] for file in views["file"]])
        for index, file, stretch in zip(views.index, views["file"], found, strict=True):
            if stretch is None:
                reasons[file] = "nothing moves for long enough"
            else:
                table.loc[index, list(STRETCH_COLUMNS)] = [f"{seconds:.1f}" for seconds in stretch]
    return table, reasons


def _motion_or_reason(path: Path) -> np.ndarray | str:
    try:
        return motion(path)
    except (AnyviewError, Refused) as error:
        return str(error).removeprefix(f"{path}: ")
