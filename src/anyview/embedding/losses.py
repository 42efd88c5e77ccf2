"""The embedding's loss, and how well it tells the time.

Frames of the same time in two clips are drawn together. Frames of other times are pushed apart by a margin.
Clips share their time profile but neither camera nor object nor goal. So what views agree on is how far the
task has come.
"""

import torch
from torch import Tensor
from torch.nn import functional as F


def squared_distances(one: Tensor, other: Tensor) -> Tensor:
    """|e_a - e_b|^2 (P, K, L) between unit vectors (P, K, D) and (P, L, D)."""
    return 2 - 2 * one @ other.mT


def triplet_loss(anchors: Tensor, others: Tensor, margin: float) -> Tensor:
    """Mean of max(0, |a_t - b_t|^2 - |a_t - b_s|^2 + margin) over pairs of clips and times s other than t.

    ``anchors`` a and ``others`` b are (P, K, D): P pairs of clips at the same K times.
    """
    distances = squared_distances(anchors, others)
    positive = distances.diagonal(dim1=1, dim2=2)[:, :, None]
    hinge = F.relu(positive - distances + margin)
    count = hinge.shape[0] * hinge.shape[1] * (hinge.shape[1] - 1)
    return (hinge.sum() - margin * hinge.shape[0] * hinge.shape[1]) / count


def time_error(anchors: Tensor, others: Tensor) -> Tensor:
    """Mean |s - t| / T, where b_s is the frame of ``others`` (P, T, D) nearest to a_t of ``anchors``.

    Guessing gives about 1/3.
    """
    nearest = squared_distances(anchors, others).argmin(-1)
    times = torch.arange(anchors.shape[1], device=anchors.device)
    return (nearest - times).abs().float().mean() / anchors.shape[1]
