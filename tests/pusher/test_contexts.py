"""Contexts obey their definition, whatever the seed."""

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anyview.pusher.contexts import COLOURS, Choice, Context, Distractor, sample_contexts
from anyview.pusher.kinematics import tool_pose
from anyview.pusher.path import clearance
from anyview.pusher.scene import ARENA_CENTRE, ARENA_RADIUS, GOAL_COLOURS, JOINT_RANGE, OBJECT_COLOUR
from anyview.tasks.push import CUP, OBJECT_RADIUS


@settings(max_examples=8)
@given(st.integers(0, 2**32), st.sampled_from(["diverse", "narrow", "choice"]))
def test_contexts_obey_their_definition(seed: int, kind: str) -> None:
    contexts, acceptance = sample_contexts(np.random.default_rng(seed), 20, kind)
    assert len(contexts) == 20
    assert {len(context.goals) for context in contexts} == {2 if kind == "choice" else 1}
    assert 0 < acceptance < 1
    for context in contexts:
        object_xy, goals = np.array(context.object_xy), [np.array(goal) for goal in context.goals]
        assert context.goal_xy in context.goals
        for one, other in itertools.combinations([object_xy, *goals], 2):
            assert np.linalg.norm(one - other) >= 0.45
        for place in (object_xy, *goals):
            assert np.linalg.norm(place - ARENA_CENTRE) <= ARENA_RADIUS
        assert (np.abs(context.arm_qpos) < JOINT_RANGE).all()
        start = tool_pose(np.array(context.arm_qpos))[None, None]
        assert clearance(CUP, OBJECT_RADIUS, start, object_xy[None, None])[0] > 0
        for distractor in context.distractors:
            for colour in (*list(GOAL_COLOURS.values())[: len(goals)], OBJECT_COLOUR):
                assert np.linalg.norm(np.array(distractor.colour) - colour) >= 0.5
            for place in (object_xy, *goals):
                assert np.linalg.norm(distractor.position - place) >= 0.2
        assert Context.from_json(context.to_json()) == context


def test_either_goal_of_two_can_be_the_one_that_counts() -> None:
    contexts, _ = sample_contexts(np.random.default_rng(2), 40, "choice")
    for context in contexts:
        red, green = (context.choosing(colour) for colour in COLOURS)
        assert (red.goal_xy, green.goal_xy) == context.goals == red.goals == green.goals
        assert context in (red, green)
        assert green.choosing("red") == red
        assert replace(green, goal_xy=red.goal_xy, choice=red.choice) == red
        assert Context.from_json(green.to_json()) == green
    assert {context.choice.colour for context in contexts} == set(COLOURS)


def test_nothing_but_a_coin_says_which_goal_counts() -> None:
    """Not where the arm starts, nor on which side of its cup a goal lies."""
    contexts, _ = sample_contexts(np.random.default_rng(7), 400, "choice")
    start = tool_pose(np.array([context.arm_qpos for context in contexts]))[:, 2]
    way = np.array([context.goal_xy for context in contexts]) - [context.object_xy for context in contexts]
    left = np.sin(np.arctan2(way[:, 1], way[:, 0]) - start) > 0
    red = np.array([context.choice.colour == "red" for context in contexts])
    for side in (left, red, left == red):
        assert side.mean() == pytest.approx(0.5, abs=0.1)  # four standard deviations


def numbers(value: object) -> Iterator[float]:
    """Every floating-point number in nested tuples of dataclasses."""
    if isinstance(value, Choice | Context | Distractor):
        value = tuple(vars(value).values())
    if isinstance(value, tuple):
        for part in value:
            yield from numbers(part)
    elif isinstance(value, float):
        yield value


@pytest.mark.parametrize("kind", ["diverse", "narrow", "choice"])
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


@pytest.mark.parametrize("choice", [Choice("red", (float("inf"), 0.0)), Choice("blue", (0.0, 0.0))])
def test_an_impossible_second_goal_is_refused(choice: Choice) -> None:
    context = sample_contexts(np.random.default_rng(9), 1)[0][0]
    with pytest.raises(ValueError, match=r"^context: choice"):
        replace(context, choice=choice)


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
