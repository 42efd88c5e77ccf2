"""Strike: a ball's path under its friction, contexts by their definition, the expert in unseen contexts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anyview.pusher.batch import MAX_TWIST, PusherBatch
from anyview.pusher.contexts import Context, sample_contexts
from anyview.pusher.expert import roll_out
from anyview.pusher.kinematics import tool_pose
from anyview.pusher.path import clearance
from anyview.pusher.scene import ARENA_CENTRE
from anyview.pusher.task import load_task
from anyview.tasks.strike import BALL_RADIUS, MALLET, RELEASE, ROLL_SECONDS, SEAT, ZONE_RADIUS, strike_pose

TASK = load_task("strike")


def goals(contexts: list[Context]) -> np.ndarray:
    return np.array([context.goal_xy for context in contexts])


@settings(max_examples=5)
@given(st.integers(0, 2**32), st.sampled_from(["diverse", "narrow"]))
def test_contexts_obey_their_definition(seed: int, kind: str) -> None:
    contexts, _ = sample_contexts(np.random.default_rng(seed), 20, kind, "strike")
    reach = TASK.workspace + SEAT  # as far as a ball that touches the mallet can be
    for context in contexts:
        ball = np.array(context.object_xy)
        start = tool_pose(np.array(context.arm_qpos))[None, None]
        assert np.linalg.norm(ball - ARENA_CENTRE) <= 0.1
        assert np.linalg.norm(start[0, 0, :2] - ARENA_CENTRE) < TASK.workspace
        assert clearance(MALLET, BALL_RADIUS, start, ball[None, None])[0] > 0
        assert np.linalg.norm(np.array(context.goal_xy) - ARENA_CENTRE) > reach + TASK.tolerance
        assert Context.from_json(context.to_json()) == context


def test_a_struck_ball_rolls_straight_and_slows_down_by_its_friction() -> None:
    contexts, _ = sample_contexts(np.random.default_rng(1), 30, "diverse", "strike")
    positions, _ = roll_out(contexts)
    free = positions[:, 24:, 3:]  # long after the stroke
    moved = np.diff(free, axis=1)
    # m v' = -(m / ROLL_SECONDS) v by the implicit Euler method, in steps of 10 ms.
    slower = (1 + 0.01 / ROLL_SECONDS) ** -10
    np.testing.assert_allclose(moved[:, 1:], slower * moved[:, :-1], atol=1e-9)
    start, zone = positions[:, 0, 3:], goals(contexts)
    way = (zone - start) / np.linalg.norm(zone - start, axis=1, keepdims=True)
    rolled = free[:, -1] - start
    assert np.abs(rolled[:, 0] * way[:, 1] - rolled[:, 1] * way[:, 0]).max() < 0.02


def test_a_ball_at_rest_stays_at_rest() -> None:
    contexts, _ = sample_contexts(np.random.default_rng(2), 5, "diverse", "strike")
    batch = PusherBatch(contexts)
    batch.reset()
    for _ in range(49):
        batch.step(np.zeros((5, 3)))
    np.testing.assert_array_equal(batch.positions()[:, 3:], [context.object_xy for context in contexts])


def test_pushing_alone_never_brings_the_ball_home() -> None:
    """The tool goes as far towards the zone as it can, slowly, with the ball ahead of it."""
    contexts, _ = sample_contexts(np.random.default_rng(3), 20, "diverse", "strike")
    batch = PusherBatch(contexts)
    batch.reset()
    ball, zone = batch.positions()[:, 3:], goals(contexts)
    heading = strike_pose(ball, zone)[:, 2]
    forward = np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    poses = TASK.expert_poses(batch.positions()[:, :3], ball[:, None], zone)
    for step in range(49):
        tool = tool_pose(batch.positions()[:, :3])
        error = poses[:, min(step + 1, 14)] - tool
        if step >= 14:
            error[:, :2] = 0.012 * forward
        batch.step(error / 0.1 / MAX_TWIST)
    moved = np.linalg.norm(batch.positions()[:, 3:] - ball, axis=-1)
    assert (moved > 0.1).all()
    assert (batch.distance() > TASK.tolerance).all()


@pytest.mark.parametrize(("ahead", "counts"), [(SEAT, False), (SEAT + 0.05, True)])
def test_a_ball_that_is_held_near_the_zone_does_not_count(ahead: float, counts: bool) -> None:
    """Two moments: the ball just before the zone, ``ahead`` of the mallet, and then in its middle."""
    here, there = np.array([0.3, -0.8, 0.5]), np.zeros(3)
    tool = tool_pose(here)
    ball = tool[:2] + ahead * np.array([np.cos(tool[2]), np.sin(tool[2])])
    zone = ball + np.array([ZONE_RADIUS, 0.0])
    positions = np.array([[[*here, *ball], [*there, *zone]]])
    (left,) = TASK.distance(positions, zone[None])
    assert left == pytest.approx(0.0 if counts else TASK.tolerance + RELEASE)


def test_expert_succeeds_in_unseen_contexts_on_one_time_profile() -> None:
    contexts, _ = sample_contexts(np.random.default_rng(987654321), 1000, "diverse", "strike")
    positions, distances = roll_out(contexts)
    assert (distances < TASK.tolerance).mean() >= 0.99
    ball = np.linalg.norm(np.diff(positions[:, :, 3:], axis=1), axis=-1)
    tool = np.linalg.norm(np.diff(tool_pose(positions[..., :3])[..., :2], axis=1), axis=-1)
    assert ball[:, :13].max() < 1e-6  # nobody touches the ball before the stroke
    assert (ball[:, 19:30].min(axis=1) > 0.004).all()  # every ball rolls at the same steps
    to_go = np.linalg.norm(positions[..., 3:] - goals(contexts)[:, None], axis=-1)
    moments = positions.reshape(-1, 1, 5)
    gaps = clearance(MALLET, BALL_RADIUS, tool_pose(moments[..., :3]), moments[..., 3:])
    let_go = np.where(gaps.reshape(to_go.shape) < 0.005, to_go, np.inf).min(axis=1)
    assert (let_go > TASK.tolerance + RELEASE + 0.04).all()  # two pixels before it has to
    assert tool[:, 24:].max() < 1e-3  # while the arm rests
    assert ball[:, -1].max() < 1e-3  # and rests at the end, too
