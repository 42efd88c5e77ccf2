"""A clip's exposure and white balance brought to those of its first frame.

Cameras let both wander, and the first frame, which is all that a translator knows of a context, does not say
where to. The thesis normalises its inputs for such reasons (section 3.2).
"""

from functools import reduce

import cv2
import numpy as np

_DARKEST, _BRIGHTEST = 16, 250  # grey levels: a gain does not explain what is darker or brighter
_LEAST_USABLE = 0.05  # of a picture's pixels, or the frame is left as it is
_ENOUGH = 500  # pixels for a fit: of more, every n-th is looked at
_ROUNDS = 4
_LEAST_TOLERANCE = 4.0  # grey levels: no two pictures of one scene are more alike, for noise
_LARGEST_GAIN = 2.0


def even_exposure(frames: np.ndarray) -> np.ndarray:
    """``frames``, uint8 (T, H, W, 3), scaled by a gain a frame and colour: what stands still looks as it did.

    The gains are fitted to the pixels that do not move, which must be the greater part of a picture.
    """
    evened = frames.copy()
    step = max(frames[0].size // (3 * _ENOUGH), 1)
    first, *others = frames.reshape(len(frames), -1, 3)[:, ::step].transpose(0, 2, 1)
    levels = np.arange(256.0)[:, None]
    for frame, sample, result in zip(frames[1:], others, evened[1:], strict=True):
        scaled = np.clip(np.rint(levels * _gains(sample, first)), 0, 255).astype(np.uint8)
        cv2.LUT(frame, scaled[:, None], dst=result)
    return evened


def _gains(frame: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Gains (3,) that take the pixels of ``frame`` that stand still to those of ``first``, uint8 (3, N)."""
    lowest = reduce(np.minimum, (*frame, *first))  # over colours: reductions of three numbers are slow
    highest = reduce(np.maximum, (*frame, *first))
    usable = (lowest >= _DARKEST) & (highest <= _BRIGHTEST)
    if usable.mean() < _LEAST_USABLE:
        return np.ones(3)
    # Sums of products of whole numbers are exact in float64, in whatever order a machine adds them.
    now, then = frame[:, usable].astype(np.float64), first[:, usable].astype(np.float64)
    across, along = then * now, now * now
    middle = now.shape[1] // 2
    gains = np.partition(then / now, middle)[:, middle]
    still = None
    for _ in range(_ROUNDS):
        errors = reduce(np.maximum, np.abs(gains[:, None] * now - then))
        before, still = still, errors <= max(2.0 * np.partition(errors, middle)[middle], _LEAST_TOLERANCE)
        if before is not None and np.array_equal(before, still):
            break
        gains = (across @ still) / (along @ still)
    return np.clip(gains, 1 / _LARGEST_GAIN, _LARGEST_GAIN)
