"""Replay keeps the newest rows; the noise has the statistics that it claims."""

import numpy as np
import torch
from hypothesis import given
from hypothesis import strategies as st

from anyview.learners.common.noise import ornstein_uhlenbeck
from anyview.learners.common.replay import Replay


@given(st.lists(st.integers(1, 7), min_size=1, max_size=12), st.integers(7, 20))
def test_replay_holds_the_newest_rows_in_order(sizes: list[int], capacity: int) -> None:
    replay, written = Replay(2, capacity, 1, torch.device("cpu")), []
    for size in sizes:
        rows = torch.arange(len(written), len(written) + size).float()
        replay.add(torch.stack([rows, -rows])[..., None])
        written += rows.tolist()
    expected = written[::-1][:capacity]
    assert replay.size == len(expected)
    taken = replay.take(torch.arange(replay.size).expand(2, -1))[..., 0]
    assert taken[0].tolist() == expected
    assert taken[1].tolist() == [-row for row in expected]
    newest = min(sizes[0], replay.size)
    replay.rewrite(0, torch.arange(2.0 * newest).view(2, newest))
    taken = replay.take(torch.arange(replay.size).expand(2, -1))[..., 0]
    rewritten = [2 * newest - 1 - age for age in range(newest)]
    assert taken[1].tolist() == rewritten + [-row for row in expected[newest:]]


def test_noise_is_stationary_with_unit_variance_and_the_stated_memory() -> None:
    rng = np.random.default_rng(0)
    path = ornstein_uhlenbeck(rng, 49, (20_000,), theta=0.3)
    np.testing.assert_allclose(path.std(axis=1), 1, atol=0.03)
    np.testing.assert_allclose((path[10] * path[13]).mean(), 0.7**3, atol=0.03)
    white = ornstein_uhlenbeck(rng, 49, (20_000,), theta=1.0)
    assert abs((white[10] * white[11]).mean()) < 0.03
