"""Temporal cycle-consistency by hand, frame by frame."""

import itertools
import math

import numpy as np
import pytest
import torch

from anyview.embedding.cycles import cycle_loss, time_error


def soft_nearest(frame: np.ndarray, clip: np.ndarray, temperature: float) -> list[float]:
    """Weights of the frames of ``clip`` by their likeness to ``frame``."""
    scores = [math.exp(-sum((frame - other) ** 2) / temperature) for other in clip]
    return [score / sum(scores) for score in scores]


@pytest.mark.parametrize("temperature", [0.1, 1.0])
def test_the_loss_is_that_of_every_cycle_of_every_two_clips(temperature):
    rng = np.random.default_rng(0)
    clips, times = rng.normal(size=(3, 5, 4)), np.sort(rng.random((3, 5)))
    errors = []
    for i, j in itertools.permutations(range(3), 2):
        for frame, left in zip(clips[i], times[i], strict=True):
            weights = soft_nearest(frame, clips[j], temperature)
            there = sum(weight * each for weight, each in zip(weights, clips[j], strict=True))
            back = soft_nearest(there, clips[i], temperature)
            errors.append((sum(map(math.prod, zip(back, times[i], strict=True))) - left) ** 2)
    found = cycle_loss(torch.from_numpy(clips), torch.from_numpy(times), temperature)
    assert found.item() == pytest.approx(np.mean(errors))


def test_clips_that_pass_the_same_places_are_in_cycle_at_any_tempo():
    way = torch.linspace(0, 1, 20, dtype=torch.float64)
    times = way.expand(2, -1)
    clips = torch.stack([way, way**2])[..., None] * 100  # the second starts slowly
    assert cycle_loss(clips, times, 0.1).item() < 0.003
    lost = torch.stack([way, torch.zeros_like(way)])[..., None] * 100  # the second stands still
    assert cycle_loss(lost, times, 0.1).item() > 0.04


def test_time_error_counts_frames_to_the_nearest():
    clip = torch.from_numpy(np.random.default_rng(0).normal(size=(2, 10, 4)))
    assert time_error(clip, clip).item() == 0
    assert time_error(clip, clip.roll(1, dims=1)).item() == pytest.approx((9 * 1 + 9) / 10 / 10)
