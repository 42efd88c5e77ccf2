"""Where the task's object is in a picture.

It is blue, in the rig as in the simulation, and nothing else on the table is as blue. So its place can be
read off true and translated pictures alike, without anybody marking it.
"""

import cv2
import numpy as np

_LEAST_BLUE = 0.25  # of a pixel's blue must be beyond its red and its green, or the pixel is not the object's
_DARK = 64.0  # grey levels: below these the colour of a pixel is noise
_LEAST_SUM = 1.0  # of what the object's pixels have beyond that fraction: a hint of blue is no object


def find_object(frame: np.ndarray) -> np.ndarray:
    """Place (2,), x and y in pixels, of the blue object in ``frame``, uint8 (H, W, 3); NaN if there is none.

    The centroid of the patch that is bluest in sum, each pixel weighted by how blue it is. Blue is measured
    relative to the pixel's brightness, so that a shaded side counts like a lit one.
    """
    red, green, blue = (frame[..., channel].astype(np.float32) for channel in range(3))
    blueness = (blue - np.maximum(red, green)) / np.maximum(blue, _DARK)
    weights = np.maximum(blueness - _LEAST_BLUE, 0.0)
    count, labels = cv2.connectedComponents((weights > 0).astype(np.uint8))
    sums = np.bincount(labels.ravel(), weights.ravel(), count)
    patch = int(np.argmax(sums))
    if sums[patch] < _LEAST_SUM:
        return np.full(2, np.nan)
    y, x = np.nonzero(labels == patch)
    return np.array([x, y]) @ weights[y, x] / sums[patch]
