"""What a translation must beat, and where it puts the object: yardsticks beside the losses."""

import math

import numpy as np

from anyview.translator.losses import FRAME_SCALE
from anyview.video.places import find_object

RADIUS = 2.0  # pixels: an object nearer than this to its true place is placed

_LEAST_SHOWN = 0.5  # of a clip's true frames must show the object, or the clip has none


def yardsticks(translated: np.ndarray, true: np.ndarray) -> dict[str, float]:
    """Of a ``translated`` clip and what happened, both uint8 (T, H, W, 3).

    - ``copy_loss``, ``mean_loss``: L_tr of what needs no translator, see the functions of these names.
    - ``placed``: share of the frames with the object within 2 pixels of its true place; an object that is not
      found is not placed. Frames that do not show the object in truth are left out.
    - ``placed_on_way``: the same among the frames in which the object is 2 pixels or more from where it
      starts and from where it ends.
    - ``copy_placed``: ``placed`` of the first frame repeated. On the way that one places nothing.

    The three last are NaN for a clip without a blue object, ``placed_on_way`` also if it hardly moves.
    """
    places = np.stack([find_object(frame) for frame in true])
    shown = np.isfinite(places[:, 0])
    placed = {"placed": math.nan, "placed_on_way": math.nan, "copy_placed": math.nan}
    if shown[0] and shown.mean() >= _LEAST_SHOWN:
        found = np.stack([find_object(frame) for frame in translated[shown]])
        places = places[shown]
        near = _distances(found, places) < RADIUS
        from_start, from_end = (_distances(places, places[n]) for n in (0, -1))
        on_way = (from_start >= RADIUS) & (from_end >= RADIUS)
        placed["placed"] = float(near.mean())
        placed["placed_on_way"] = float(near[on_way].mean()) if on_way.any() else math.nan
        placed["copy_placed"] = float((from_start < RADIUS).mean())
    return {"copy_loss": copy_loss(true), "mean_loss": mean_loss(true), **placed}


def copy_loss(clip: np.ndarray) -> float:
    """L_tr of the first frame repeated, each colour of each frame scaled by the gain that fits best."""
    first, *_ = frames = clip.astype(np.float64)
    gains = (frames * first).sum(axis=(1, 2)) / np.maximum((first * first).sum(axis=(0, 1)), 1.0)
    return _loss(gains[:, None, None] * first, frames)


def mean_loss(clip: np.ndarray) -> float:
    """L_tr of the clip's own mean picture, repeated: the best still picture in hindsight."""
    frames = clip.astype(np.float64)
    return _loss(frames.mean(axis=0), frames)


def _loss(guess: np.ndarray, frames: np.ndarray) -> float:
    """L_tr of ``guess`` for ``frames`` (T, H, W, 3), both in grey levels."""
    return FRAME_SCALE * float(np.square((guess - frames) / 127.5).sum()) / len(frames)


def _distances(places: np.ndarray, others: np.ndarray) -> np.ndarray:
    return np.hypot(*(places - others).T)
