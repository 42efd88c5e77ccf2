"""Temporal cycle-consistency (Dwibedi et al. 2019), the loss of XIRL's embedding (Zakka et al. 2021).

From a frame of one clip to its soft nearest neighbour in another clip, and from there back to the first: that
must come back to the time that it left from. No clip is told how far it is, nor which clips are of one body.
"""

import torch
from torch import Tensor
from torch.nn import functional as F


def cycle_loss(embedded: Tensor, times: Tensor, temperature: float) -> Tensor:
    """Mean squared error of the time that a frame comes back at, over all ordered pairs of S clips.

    ``embedded`` (S, K, D) are K frames of each, of any length. ``times`` (S, K) are when these are, as parts
    of their clips, 0 to 1. Similarity is -|a - b|^2 / temperature.
    """
    here, there = (~torch.eye(len(embedded), dtype=torch.bool, device=embedded.device)).nonzero(as_tuple=True)
    one, other = embedded[here], embedded[there]
    nearest = _similarities(one, other, temperature).softmax(-1) @ other
    back = _similarities(nearest, one, temperature).softmax(-1)
    arrived = (back @ times[here][..., None])[..., 0]
    return F.mse_loss(arrived, times[here])


def time_error(one: Tensor, other: Tensor) -> Tensor:
    """Mean |s - t| / T, where frame s of ``other`` (P, T, D) is nearest to frame t of ``one`` (P, T, D).

    The clips of a pair are in step. Guessing gives about 1/3.
    """
    nearest = _similarities(one, other, 1.0).argmax(-1)
    times = torch.arange(one.shape[1], device=one.device)
    return (nearest - times).abs().float().mean() / one.shape[1]


def _similarities(one: Tensor, other: Tensor, temperature: float) -> Tensor:
    """(P, K, L) of frames (P, K, D) and (P, L, D)."""
    squares = one.square().sum(-1)[..., None] + other.square().sum(-1)[:, None] - 2 * one @ other.mT
    return -squares / temperature
