"""Clips of the rig and simulated ones keep step: by what both scripts do, not by what the map believes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from anyview.pusher.contexts import sample_contexts
from anyview.pusher.expert import roll_out
from anyview.pusher.path import FRAMES
from anyview.seeds import stream
from anyview.surrogate.push import STEP, sample_push
from anyview.video.phases import LENGTH, SECONDS, frames_in_step, seconds_at, seconds_of, steps_at


def progress(track: np.ndarray) -> np.ndarray:
    """How far an object has come (T,), of its way from first to last; ``track`` (T, 2)."""
    away = np.linalg.norm(track - track[0], axis=1)
    return away / away[-1]


@pytest.fixture(scope="module")
def simulated() -> np.ndarray:
    """Mean progress (50,) of the simulated expert's object."""
    positions, _ = roll_out(sample_contexts(stream(0, "test"), 30)[0])
    return np.mean([progress(track[:, 3:]) for track in positions], axis=0)


def test_the_object_has_come_as_far_where_the_map_says(simulated):
    """Of 40 pushes of the hand the mean is within an eighth of the way of the robot's at every step."""
    tracks = [sample_push(stream(0, "test push", index)).object_xy for index in range(40)]
    at = (seconds_at(np.arange(LENGTH)) / STEP).round().astype(int)
    hand = np.array([progress(track)[at] for track in tracks])
    assert np.abs(hand.mean(axis=0) - simulated).max() < 0.125
    # It starts to move and stops within two steps of each other.
    for fraction in (0.05, 0.95):
        steps = (hand > fraction).argmax(axis=1)
        assert abs(np.median(steps) - (simulated > fraction).argmax()) <= 2


def test_steps_come_back_from_seconds():
    steps = np.arange(FRAMES)
    assert (steps_at(seconds_at(steps)) == steps).all()
    assert FRAMES == LENGTH


@given(st.lists(st.floats(0, SECONDS), min_size=2))
def test_later_is_never_earlier(seconds):
    steps = steps_at(np.sort(seconds))
    assert (np.diff(steps) >= 0).all()
    assert steps.min() >= 0
    assert steps.max() < LENGTH


@pytest.mark.parametrize("length", [80, 160])
def test_frames_in_step_are_in_order_and_near_their_time(length):
    seconds = seconds_of(length)
    frames = frames_in_step(seconds)
    assert frames.shape == (LENGTH,)
    assert (np.diff(frames) > 0).all()
    assert np.abs(seconds[frames] - seconds_at(np.arange(LENGTH))).max() <= SECONDS / length
    assert frames[-1] == length - 1
