"""How alike two clips look: PSNR and SSIM, beside the losses."""

import math

import numpy as np
import torch
from torch.nn import functional as F

_RANGE = 255.0
_WINDOW, _SIGMA = 11, 1.5
_C1, _C2 = (0.01 * _RANGE) ** 2, (0.03 * _RANGE) ** 2
_BEST = 100.0  # dB, for equal clips: a table holds no infinity


def psnr(clip: np.ndarray, reference: np.ndarray) -> float:
    """Peak signal-to-noise ratio in dB, at most 100, of the mean square error between two uint8 clips."""
    error = np.mean((clip.astype(np.float64) - reference) ** 2)
    return min(_BEST, 10 * math.log10(_RANGE**2 / error)) if error else _BEST


def ssim(clip: np.ndarray, reference: np.ndarray) -> float:
    """Mean structural similarity of uint8 clips (T, H, W, 3), over frames, colours and whole windows.

    Wang, Bovik, Sheikh and Simoncelli (2004): Gaussian windows of 11x11 pixels with sigma 1.5, K1 = 0.01,
    K2 = 0.03.
    """
    x, y = (
        torch.from_numpy(frames).double().movedim(-1, 1).flatten(0, 1)[:, None]
        for frames in (clip, reference)
    )
    means = _blur(torch.cat((x, y, x * x, y * y, x * y)))
    mx, my, xx, yy, xy = means.chunk(5)
    similarity = (2 * mx * my + _C1) * (2 * (xy - mx * my) + _C2)
    similarity /= (mx * mx + my * my + _C1) * (xx - mx * mx + yy - my * my + _C2)
    return float(similarity.mean())


def _blur(pictures: torch.Tensor) -> torch.Tensor:
    offsets = torch.arange(_WINDOW, dtype=torch.float64) - _WINDOW // 2
    kernel = torch.exp(-(offsets**2) / (2 * _SIGMA**2))
    kernel /= kernel.sum()
    return F.conv2d(F.conv2d(pictures, kernel[None, None, None]), kernel[None, None, :, None])
