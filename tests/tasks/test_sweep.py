"""Sweep: grains at rest and in contact, contexts by their definition, and the expert in unseen contexts."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anyview.pusher.batch import PusherBatch, observation_size
from anyview.pusher.contexts import Context, sample_contexts
from anyview.pusher.expert import roll_out
from anyview.pusher.kinematics import tool_pose
from anyview.pusher.path import clearance
from anyview.pusher.scene import ARENA_CENTRE, ARENA_RADIUS
from anyview.pusher.task import load_task
from anyview.tasks.sweep import BROOM, GRAIN_RADIUS, ZONE_RADIUS

TASK = load_task("sweep")


@settings(max_examples=5)
@given(st.integers(0, 2**32), st.sampled_from(["diverse", "narrow"]))
def test_contexts_obey_their_definition(seed: int, kind: str) -> None:
    contexts, _ = sample_contexts(np.random.default_rng(seed), 20, kind, "sweep")
    for context in contexts:
        grains = np.array(context.object_xy).reshape(5, 2)
        for one, other in itertools.combinations(grains, 2):
            assert np.linalg.norm(one - other) > 2 * GRAIN_RADIUS
        assert np.linalg.norm(grains.mean(0) - context.goal_xy) >= 0.43  # 0.45 from the ring's middle
        assert (np.linalg.norm(grains - context.goal_xy, axis=-1) > ZONE_RADIUS).all()
        assert np.linalg.norm(np.array(context.goal_xy) - ARENA_CENTRE) <= ARENA_RADIUS
        start = tool_pose(np.array(context.arm_qpos))[None, None]
        assert clearance(BROOM, GRAIN_RADIUS, start, grains[None])[0] > 0
        assert Context.from_json(context.to_json()) == context


def test_grains_at_rest_stay_at_rest() -> None:
    contexts, _ = sample_contexts(np.random.default_rng(1), 5, "diverse", "sweep")
    batch = PusherBatch(contexts)
    batch.reset()
    for _ in range(49):
        batch.step(np.zeros((5, 3)))
    np.testing.assert_array_equal(batch.positions()[:, 3:], [context.object_xy for context in contexts])


def test_grains_push_each_other_and_do_not_overlap() -> None:
    contexts, _ = sample_contexts(np.random.default_rng(2), 30, "diverse", "sweep")
    positions, _ = roll_out(contexts)
    grains = positions[..., 3:].reshape(30, 50, 5, 2)
    apart = np.linalg.norm(grains[..., :, None, :] - grains[..., None, :, :], axis=-1)
    apart[..., range(5), range(5)] = np.inf
    assert apart.min() > 2 * GRAIN_RADIUS - 0.008  # contacts are soft
    assert np.median(apart[:, -1].min(axis=(1, 2))) < 2 * GRAIN_RADIUS + 0.002


@pytest.mark.parametrize(("inside", "success"), [(3, False), (4, True), (5, True)])
def test_four_grains_in_the_zone_are_a_success(inside: int, success: bool) -> None:
    zone = np.array([0.6, 0.1])
    away = np.where(np.arange(5) < inside, ZONE_RADIUS - 0.01, ZONE_RADIUS + 0.01)
    grains = zone + away[:, None] * np.array([[np.cos(a), np.sin(a)] for a in range(5)])
    positions = np.concatenate([np.zeros(3), grains.ravel()])[None, None]
    assert (TASK.distance(positions, zone[None])[0] < TASK.tolerance) == success


def test_an_observation_has_every_grain() -> None:
    contexts, _ = sample_contexts(np.random.default_rng(4), 3, "diverse", "sweep")
    seen = PusherBatch(contexts).reset()
    assert seen.shape == (3, observation_size("sweep", 1)) == (3, 23)
    places = ARENA_CENTRE + ARENA_RADIUS * seen[:, 10:20].reshape(3, 5, 2)
    expected = np.array([context.object_xy for context in contexts]).reshape(3, 5, 2)
    np.testing.assert_allclose(places, expected, atol=1e-6)


def test_expert_succeeds_in_unseen_contexts_on_one_time_profile() -> None:
    contexts, _ = sample_contexts(np.random.default_rng(987654321), 1000, "diverse", "sweep")
    positions, distances = roll_out(contexts)
    assert (distances < TASK.tolerance).mean() >= 0.99
    grains = positions[..., 3:].reshape(1000, 50, 5, 2)
    speed = np.linalg.norm(np.diff(grains, axis=1), axis=-1).max(-1)
    assert speed[:, :13].max() < 1e-6  # nobody touches a grain before the sweep
    assert (speed[:, 22:38].min(axis=1) > 0.004).all()  # everybody sweeps at the same steps
    assert speed[:, 44:].max() < 2e-3  # and rests at the same steps
