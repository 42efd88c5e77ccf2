"""How alike two clips look: PSNR and SSIM, beside the losses."""

import math

import numpy as np
import torch

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
    x, y = (torch.from_numpy(frames).double().movedim(-1, 1).flatten(0, 1) for frames in (clip, reference))
    means = _blur(torch.cat((x, y, x * x, y * y, x * y)))
    mx, my, xx, yy, xy = means.chunk(5)
    similarity = (2 * mx * my + _C1) * (2 * (xy - mx * my) + _C2)
    similarity /= (mx * mx + my * my + _C1) * (xx - mx * mx + yy - my * my + _C2)
    return float(similarity.mean())


def _blur(pictures: torch.Tensor) -> torch.Tensor:
    rows, columns = map(_windows, pictures.shape[-2:])
    return rows @ pictures @ columns.T  # convolutions of doubles take three times as long


def _windows(side: int) -> torch.Tensor:
    """The weights (S - 10, S) of the S pixels of a line in each window that is whole."""
    offsets = torch.arange(side) - torch.arange(side - _WINDOW + 1)[:, None] - _WINDOW // 2
    weights = torch.exp(-(offsets.double() ** 2) / (2 * _SIGMA**2)) * (offsets.abs() <= _WINDOW // 2)
    return weights / weights.sum(1, keepdim=True)
