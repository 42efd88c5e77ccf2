"""Reach: contexts by their definition, distance against MuJoCo, and the expert in unseen contexts."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anyview.pusher.batch import PusherBatch
from anyview.pusher.contexts import Context, sample_contexts
from anyview.pusher.expert import roll_out
from anyview.pusher.kinematics import tool_pose
from anyview.pusher.scene import ARENA_CENTRE, ARENA_RADIUS, JOINT_RANGE, LINK
from anyview.pusher.task import load_task
from anyview.runtime.errors import AnyviewError


@settings(max_examples=5)
@given(st.integers(0, 2**32), st.sampled_from(["diverse", "narrow"]))
def test_contexts_obey_their_definition(seed: int, kind: str) -> None:
    contexts, acceptance = sample_contexts(np.random.default_rng(seed), 20, kind, "reach")
    assert 0 < acceptance < 1
    for context in contexts:
        tool = tool_pose(np.array(context.arm_qpos))[:2]
        assert context.object_xy == ()
        assert np.linalg.norm(tool - context.goal_xy) >= 0.45 - 1e-5
        for place in (tool, context.goal_xy):
            assert np.linalg.norm(place - ARENA_CENTRE) <= ARENA_RADIUS + 1e-5
        assert (np.abs(context.arm_qpos) < JOINT_RANGE).all()
        assert Context.from_json(context.to_json()) == context


def test_there_is_no_choice_of_goals() -> None:
    with pytest.raises(AnyviewError, match="task reach: no choice contexts; it has diverse and narrow"):
        sample_contexts(np.random.default_rng(0), 1, "choice", "reach")


def test_the_distance_is_that_of_mujocos_tool_point() -> None:
    contexts, _ = sample_contexts(np.random.default_rng(1), 4, "diverse", "reach")
    batch = PusherBatch(contexts, "torque")
    batch.reset()
    for actions in np.random.default_rng(2).uniform(-1, 1, (10, 4, 3)):
        batch.step(actions)
    scene = load_task("reach").model("torque")
    data = mujoco.MjData(scene)
    for context, joints, distance in zip(contexts, batch.positions(), batch.distance(), strict=True):
        data.qpos[:] = joints
        mujoco.mj_kinematics(scene, data)
        link = data.body("link2")
        tool = link.xpos + link.xmat.reshape(3, 3) @ [LINK, 0, 0]
        assert distance == pytest.approx(np.linalg.norm(tool[:2] - context.goal_xy), abs=1e-9)


def test_expert_succeeds_in_unseen_contexts_on_one_time_profile() -> None:
    contexts, _ = sample_contexts(np.random.default_rng(987654321), 1000, "diverse", "reach")
    positions, distances = roll_out(contexts)
    assert (distances < 0.02).mean() >= 0.99
    speed = np.linalg.norm(np.diff(tool_pose(positions)[..., :2], axis=1), axis=-1)
    assert (speed[:, 8:26].min(axis=1) > 0.004).all()  # everybody moves at the same steps
    assert speed[:, 37:].max() < 1e-3  # and rests at the same steps
