"""A clip's exposure and white balance brought to those of its first frame.

Cameras let both wander, and the first frame, which is all that a translator knows of a context, does not say
where to. The thesis normalises its inputs for such reasons (section 3.2).
"""

import numpy as np

_DARKEST, _BRIGHTEST = 16, 250  # grey levels: a gain does not explain what is darker or brighter
_LEAST_USABLE = 0.05  # of a picture's pixels, or the frame is left as it is
_ROUNDS = 4
_LEAST_TOLERANCE = 4.0  # grey levels: no two pictures of one scene are more alike, for noise
_LARGEST_GAIN = 2.0


def even_exposure(frames: np.ndarray) -> np.ndarray:
    """``frames``, uint8 (T, H, W, 3), scaled by a gain a frame and colour: what stands still looks as it did.

    The gains are fitted to the pixels that do not move, which must be the greater part of a picture.
    """
    evened = frames.copy()
    first = frames[0].reshape(-1, 3).astype(np.int64)
    for frame, result in zip(frames[1:], evened[1:], strict=True):
        gains = _gains(frame.reshape(-1, 3).astype(np.int64), first)
        result[:] = np.clip(np.rint(frame * gains), 0, 255)
    return evened


def _gains(frame: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Gains (3,) that take the pixels of ``frame`` that stand still to those of ``first``, both (N, 3)."""
    low, high = np.minimum(frame, first).min(axis=1), np.maximum(frame, first).max(axis=1)
    usable = (low >= _DARKEST) & (high <= _BRIGHTEST)
    if usable.mean() < _LEAST_USABLE:
        return np.ones(3)
    frame, first = frame[usable], first[usable]
    gains = np.median(first / frame, axis=0)
    for _ in range(_ROUNDS):
        errors = np.abs(gains * frame - first).max(axis=1)
        still = errors <= max(2.0 * float(np.median(errors)), _LEAST_TOLERANCE)
        gains = (first * frame)[still].sum(axis=0) / (frame * frame)[still].sum(axis=0)
    return np.clip(gains, 1 / _LARGEST_GAIN, _LARGEST_GAIN)
