"""Augmented contexts."""

import numpy as np
import pytest
import torch

from anyview.training.augmentation import Augmentation
from anyview.video.datasets import Dataset
from anyview.video.pixels import to_input
from tests.training.discworld import clip_table, disc_clips

COUNT = 60


@pytest.fixture(scope="module")
def clips() -> Dataset:
    return Dataset("real", disc_clips(COUNT), clip_table(["train"] * (COUNT - 2) + ["validation"] * 2))


@pytest.fixture(scope="module")
def augment(clips) -> Augmentation:
    return Augmentation(clips)


def altered(augment: Augmentation, frames: torch.Tensor, seed: int = 0) -> torch.Tensor:
    return augment(frames, np.arange(frames.shape[1]), np.random.default_rng(seed))


def test_all_frames_of_a_clip_are_altered_alike(augment, clips):
    """The same picture as o_0 and as o_t stays the same picture; another clip gets another change."""
    picture = to_input(clips.frames[:58, 0])
    first, second = altered(augment, torch.stack((picture, picture)))
    assert torch.equal(first, second)
    same = to_input(np.repeat(clips.frames[:1, 0], 58, axis=0))
    results = {tuple(frame.flatten().tolist()) for frame in altered(augment, same[None])[0]}
    assert len(results) > 30


def test_alterations_follow_the_generator_and_leave_some_clips_alone(augment, clips):
    frames = to_input(clips.frames[:58, 3])[None]
    first = altered(augment, frames)
    assert torch.equal(first, altered(augment, frames))
    assert not torch.equal(first, altered(augment, frames, seed=1))
    assert first.shape == frames.shape
    assert first.abs().max() <= 1
    kept = (first == frames).flatten(2).all(2).float().mean()
    assert 0.05 < kept < 0.4


def test_motion_shows_through_every_alteration(augment, clips):
    """No distractor hides what moves: where the disc is at the end, o_T still differs from o_0."""
    first, last = altered(augment, torch.stack([to_input(clips.frames[:58, t]) for t in (0, -1)]))
    before = (to_input(clips.frames[:58, 0]) - to_input(clips.frames[:58, -1])).abs().amax((1, 2, 3))
    after = (first - last).abs().amax((1, 2, 3))
    moving = before > 0.5
    assert moving.sum() > 40
    assert (after[moving] > 0.15).float().mean() > 0.9
