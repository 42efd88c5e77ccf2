"""The embedding's loss by hand."""

import numpy as np
import pytest
import torch

from anyview.embedding.losses import squared_distances, time_error, triplet_loss


def unit_vectors(*shape: int, seed: int = 0) -> torch.Tensor:
    vectors = np.random.default_rng(seed).standard_normal(shape)
    return torch.from_numpy(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def test_triplet_loss_matches_a_literal_sum():
    one, other = unit_vectors(3, 5, 4, seed=1), unit_vectors(3, 5, 4, seed=2)
    terms = []
    for p in range(3):
        for t in range(5):
            near = ((one[p, t] - other[p, t]) ** 2).sum()
            far = [((one[p, t] - other[p, s]) ** 2).sum() for s in range(5) if s != t]
            terms += [max(0.0, (near - distance + 0.3).item()) for distance in far]
    assert triplet_loss(one, other, 0.3).item() == pytest.approx(np.mean(terms))
    expected = ((one[:, :, None] - other[:, None]) ** 2).sum(-1)
    torch.testing.assert_close(squared_distances(one, other), expected)


def test_time_error_is_zero_for_equal_clips_and_counts_frames_otherwise():
    clip = unit_vectors(2, 10, 16)
    assert time_error(clip, clip).item() == 0
    assert time_error(clip, clip.roll(1, dims=1)).item() == pytest.approx((9 * 1 + 9) / 10 / 10)
