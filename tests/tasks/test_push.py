"""Push: the expert's path, and the expert in unseen contexts."""

import numpy as np

from anyview.pusher.contexts import COLOURS, sample_contexts
from anyview.pusher.expert import roll_out
from anyview.pusher.kinematics import tool_pose
from anyview.pusher.task import load_task
from anyview.tasks.push import SEAT


def test_expert_succeeds_in_unseen_contexts_on_one_time_profile() -> None:
    contexts, _ = sample_contexts(np.random.default_rng(987654321), 1000)
    positions, distances = roll_out(contexts)
    assert (distances < 0.02).mean() >= 0.99
    speed = np.linalg.norm(np.diff(positions[:, :, 3:], axis=1), axis=-1)
    assert speed[:, :13].max() < 1e-6  # nobody touches the object before the push
    assert (speed[:, 22:38].min(axis=1) > 0.004).all()  # everybody pushes at the same steps
    assert speed[:, 44:].max() < 1e-3  # and rests at the same steps


def test_the_expert_reaches_either_goal_on_the_same_time_profile() -> None:
    contexts, _ = sample_contexts(np.random.default_rng(123456789), 1000, "choice")
    for colour in COLOURS:
        positions, distances = roll_out([context.choosing(colour) for context in contexts])
        assert (distances < 0.02).mean() >= 0.99
        speed = np.linalg.norm(np.diff(positions[:, :, 3:], axis=1), axis=-1)
        assert speed[:, :13].max() < 1e-6
        assert speed[:, 44:].max() < 1e-3


def test_the_path_pushes_from_behind_the_object_to_the_goal() -> None:
    contexts, _ = sample_contexts(np.random.default_rng(5), 50)
    arm, start, goal = (
        np.array([getattr(c, n) for c in contexts]) for n in ("arm_qpos", "object_xy", "goal_xy")
    )
    poses = load_task("push").expert_poses(arm, start[:, None], goal)
    np.testing.assert_allclose(poses[:, 0], tool_pose(arm), atol=1e-12)
    seat = poses[:, -1, :2] + SEAT * np.stack([np.cos(poses[:, -1, 2]), np.sin(poses[:, -1, 2])], -1)
    np.testing.assert_allclose(seat, goal, atol=1e-12)
    assert (np.diff(poses[:, 42:], axis=1) == 0).all()  # rest at the end
