"""Batched physics against MuJoCo stepped one simulation at a time, and the expert in it."""

import pickle

import mujoco
import numpy as np
import pytest

from anyview.pusher.batch import MAX_TWIST, PusherBatch, observation_size
from anyview.pusher.contexts import COLOURS, sample_contexts
from anyview.pusher.scene import ARENA_CENTRE, ARENA_RADIUS
from anyview.pusher.task import load_task

CONTEXTS, _ = sample_contexts(np.random.default_rng(11), 5)


@pytest.mark.parametrize("control", ["twist", "torque"])
def test_batch_equals_single_simulations(control: str) -> None:
    actions = np.random.default_rng(0).uniform(-1, 1, (30, len(CONTEXTS), 3))
    batch = PusherBatch(CONTEXTS, control)
    batch.reset()
    together = np.stack([(batch.step(a), batch.positions())[1] for a in actions])
    for index, context in enumerate(CONTEXTS):
        alone = PusherBatch([context], control)
        alone.reset()
        single = np.stack([(alone.step(a[index : index + 1]), alone.positions())[1] for a in actions])
        np.testing.assert_array_equal(together[:, index], single[:, 0])


def test_torque_steps_equal_mj_step() -> None:
    context = CONTEXTS[0]
    batch = PusherBatch([context], "torque")
    batch.reset()
    scene = load_task("push").model("torque")
    data = mujoco.MjData(scene)
    data.qpos[:] = [*context.arm_qpos, *context.object_xy]
    for action in np.random.default_rng(1).uniform(-1, 1, (20, 3)):
        batch.step(action[None])
        data.ctrl[:] = 3.0 * action
        mujoco.mj_step(scene, data, 10)
        np.testing.assert_array_equal(batch.positions()[0], data.qpos)


def test_a_twist_moves_the_tool_at_its_speed() -> None:
    batch = PusherBatch(CONTEXTS)
    before = batch.reset()
    batch.step(np.tile([0.3, -0.2, 0.1], (len(CONTEXTS), 1)))
    after = batch.step(np.tile([0.3, -0.2, 0.1], (len(CONTEXTS), 1)))
    moved = (after - before)[:, 6:8] * 0.5  # tool position, in units of the arena's radius
    np.testing.assert_allclose(moved, np.tile(MAX_TWIST[:2] * [0.3, -0.2] * 0.2, (5, 1)), atol=0.012)


def test_observations_stay_in_their_bounds_under_wild_actions() -> None:
    batch = PusherBatch(CONTEXTS, "torque")
    batch.reset()
    for _ in range(49):
        observations = batch.step(np.full((len(CONTEXTS), 3), 1.0))
        assert np.isfinite(observations).all()
        assert np.abs(observations).max() <= 3


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_an_action_that_is_not_finite_is_refused(value: float) -> None:
    batch = PusherBatch(CONTEXTS)
    before = batch.reset()
    actions = np.zeros((len(CONTEXTS), 3))
    actions[3, 1] = value
    with pytest.raises(ValueError, match="action: expected finite numbers"):
        batch.step(actions)
    np.testing.assert_array_equal(batch.observations(), before)


def test_a_pickled_batch_continues_exactly() -> None:
    actions = np.random.default_rng(2).uniform(-1, 1, (30, len(CONTEXTS), 3))
    batch = PusherBatch(CONTEXTS, image_size=32)
    batch.reset()
    for action in actions[:10]:
        batch.step(action)
    twin = pickle.loads(pickle.dumps(batch))
    for action in actions[10:]:
        np.testing.assert_array_equal(twin.step(action), batch.step(action))
        np.testing.assert_array_equal(twin.positions(), batch.positions())
    np.testing.assert_array_equal(twin.render(), batch.render())


def test_an_observation_does_not_tell_which_goal_counts() -> None:
    contexts, _ = sample_contexts(np.random.default_rng(4), 6, "choice")
    red, green = (PusherBatch([context.choosing(colour) for context in contexts]) for colour in COLOURS)
    np.testing.assert_array_equal(red.reset(), green.reset())
    for actions in np.random.default_rng(5).uniform(-1, 1, (20, 6, 3)):
        seen = red.step(actions)
        np.testing.assert_array_equal(seen, green.step(actions))
    np.testing.assert_array_equal(red.render(), green.render())
    assert seen.shape == (6, observation_size("push", 2)) == (6, 17)
    goals = np.array([context.goals for context in contexts])  # red, then green
    places = ARENA_CENTRE + ARENA_RADIUS * seen[:, 12:16].reshape(6, 2, 2)
    np.testing.assert_allclose(places, goals, atol=1e-6)
    np.testing.assert_array_equal(seen[:, 16], np.full(6, 2 * 20 / 49 - 1, np.float32))
    np.testing.assert_array_equal(red.distance(), green.other_distance())
    np.testing.assert_array_equal(red.other_distance(), green.distance())
    assert (red.distance() != red.other_distance()).all()
