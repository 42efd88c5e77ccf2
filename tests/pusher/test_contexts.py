"""Contexts obey their definition, whatever the seed."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anyview.pusher.contexts import Context, Distractor, sample_contexts
from anyview.pusher.kinematics import tool_pose
from anyview.pusher.path import clearance, expert_poses
from anyview.pusher.scene import ARENA_CENTRE, ARENA_RADIUS, GOAL_COLOUR, JOINT_RANGE, OBJECT_COLOUR, SEAT


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from(["diverse", "narrow"]))
def test_contexts_obey_their_definition(seed: int, kind: str) -> None:
    contexts, acceptance = sample_contexts(np.random.default_rng(seed), 20, kind)
    assert len(contexts) == 20
    assert 0 < acceptance < 1
    for context in contexts:
        object_xy, goal_xy = np.array(context.object_xy), np.array(context.goal_xy)
        assert np.linalg.norm(object_xy - goal_xy) >= 0.45
        for place in (object_xy, goal_xy):
            assert np.linalg.norm(place - ARENA_CENTRE) <= ARENA_RADIUS
        assert (np.abs(context.arm_qpos) < JOINT_RANGE).all()
        assert clearance(tool_pose(np.array(context.arm_qpos))[None, None], object_xy[None])[0] > 0
        for distractor in context.distractors:
            for colour in (GOAL_COLOUR, OBJECT_COLOUR):
                assert np.linalg.norm(np.array(distractor.colour) - colour) >= 0.5
        assert Context.from_json(context.to_json()) == context


def numbers(value: object) -> Iterator[float]:
    """Every floating-point number in nested tuples of dataclasses."""
    if isinstance(value, Context | Distractor):
        value = tuple(vars(value).values())
    if isinstance(value, tuple):
        for part in value:
            yield from numbers(part)
    elif isinstance(value, float):
        yield value


@pytest.mark.parametrize("kind", ["diverse", "narrow"])
def test_a_last_bit_cannot_move_a_context(kind: str) -> None:
    contexts, _ = sample_contexts(np.random.default_rng(9), 30, kind)
    values = list(numbers(tuple(contexts)))
    assert len(values) >= 30 * 8
    assert all(value == round(value, 6) for value in values)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("arm_qpos", (0.0, float("nan"), 0.0)),
        ("arm_qpos", (0.0, 0.0)),
        ("object_xy", (1e12, 0.0)),
        ("goal_xy", "left"),
        ("azimuth", None),
    ],
)
def test_a_context_in_which_physics_cannot_start_is_refused(name: str, value: object) -> None:
    context = sample_contexts(np.random.default_rng(9), 1)[0][0]
    with pytest.raises(ValueError, match=f"^context: {name}: expected "):
        replace(context, **{name: value})


def test_diverse_contexts_look_from_everywhere_past_distractors() -> None:
    contexts, _ = sample_contexts(np.random.default_rng(3), 400)
    azimuths = np.histogram([c.azimuth for c in contexts], 8, (-np.pi, np.pi))[0]
    assert azimuths.min() > 25  # 50 expected in each eighth
    visible = np.array([[d.visible for d in c.distractors] for c in contexts])
    assert visible.shape == (400, 5)
    assert visible.mean() == pytest.approx(0.5, abs=0.05)


def test_narrow_contexts_look_from_four_sides_at_a_bare_table() -> None:
    contexts, _ = sample_contexts(np.random.default_rng(3), 200, "narrow")
    off = np.rad2deg([c.azimuth for c in contexts]) % 90
    assert (np.minimum(off, 90 - off) <= 5).all()
    assert all(c.distractors == () for c in contexts)
    sides = {round(np.rad2deg(c.azimuth) / 90) % 4 for c in contexts}
    assert sides == {0, 1, 2, 3}


def test_the_path_pushes_from_behind_the_object_to_the_goal() -> None:
    contexts, _ = sample_contexts(np.random.default_rng(5), 50)
    arm, start, goal = (
        np.array([getattr(c, n) for c in contexts]) for n in ("arm_qpos", "object_xy", "goal_xy")
    )
    poses = expert_poses(arm, start, goal)
    np.testing.assert_allclose(poses[:, 0], tool_pose(arm), atol=1e-12)
    seat = poses[:, -1, :2] + SEAT * np.stack([np.cos(poses[:, -1, 2]), np.sin(poses[:, -1, 2])], -1)
    np.testing.assert_allclose(seat, goal, atol=1e-12)
    assert (np.diff(poses[:, 42:], axis=1) == 0).all()  # rest at the end
