"""Clips that keep a tempo of their own."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anyview.pusher.contexts import sample_contexts
from anyview.pusher.expert import roll_out
from anyview.pusher.kinematics import tool_pose
from anyview.pusher.task import load_task
from anyview.pusher.tempo import at_progress, draw_progress
from anyview.runtime.errors import AnyviewError
from anyview.seeds import stream

PUSH = load_task("push")


@settings(max_examples=20)
@given(st.integers(0, 2**32))
def test_progress_goes_from_the_script_s_start_to_its_end_and_never_back(seed: int) -> None:
    progress = draw_progress(np.random.default_rng(seed), 20, "push")
    assert progress.shape == (20, 50)
    assert np.array_equal(progress[:, [0, -1]], [[0, 49]] * 20)
    assert (np.diff(progress) > 0).all()
    # A phase takes 0.7 to 1.4 times its steps, or less where both would end too late.
    for clip in progress:
        approach, push = np.interp([14, 42], clip, np.arange(50))
        assert 0.6 * 14 < approach < 1.41 * 14
        assert 0.6 * 28 < push - approach < 1.42 * 28
        assert push <= 48.1


def test_the_script_s_own_progress_is_the_script() -> None:
    poses = np.random.default_rng(0).normal(size=(3, 50, 3))
    assert np.array_equal(at_progress(poses, np.tile(np.arange(50.0), (3, 1))), poses)


def test_the_expert_succeeds_at_any_tempo() -> None:
    rng = stream(11, "test")
    contexts, _ = sample_contexts(rng, 300, "choice")
    progress = draw_progress(rng, 300, "push")
    positions, distances = roll_out(contexts, progress)
    assert (distances < PUSH.tolerance).mean() >= 0.99
    # As far as it says: the tool is where the script's would be, give or take what the servo lags behind.
    script = tool_pose(roll_out(contexts)[0][:, :, :3])[..., :2]
    tool = tool_pose(positions[:, :, :3])[..., :2]
    expected = np.stack(
        [
            [np.interp(now, np.arange(50), way[:, axis]) for axis in range(2)]
            for way, now in zip(script, progress, strict=True)
        ]
    ).swapaxes(1, 2)
    assert np.linalg.norm(tool - expected, axis=-1).max() < 0.03
    assert np.linalg.norm(tool - script, axis=-1).max() > 0.1


def test_a_task_without_phases_says_so() -> None:
    with pytest.raises(AnyviewError, match="no phases to stretch"):
        draw_progress(np.random.default_rng(0), 2, "reach")
