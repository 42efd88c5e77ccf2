"""Scripted rollouts: in each context some that do the task, and some that fail in a known way.

None of them needs a policy. Shapes: R contexts, n rollouts of a kind in each, k objects.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from anyview.pusher.contexts import COLOURS, Context
from anyview.pusher.expert import roll_out
from anyview.pusher.path import FRAMES
from anyview.pusher.proposals import in_disc
from anyview.pusher.task import load_task
from anyview.trigonometry import unit_vector

GOOD = "good"
STILL, LEFT_BEHIND, WRONG_PLACE, STOPPED = "still", "left_behind", "wrong_place", "stopped"
OTHER_GOAL = "other_goal"

_NEAR = 0.75  # of the tolerance, at most, that a good rollout ends from the goal
_WRONG = (0.05, 0.3)  # metres from the goal to a wrong place
_TRIES = 4  # wrong places for each that is wanted: the arm does not reach all of them
_HALF_WAY = (22, 35)  # steps between which an expert stops; at step 28 `push` has done half of its way


def scripted_rollouts(
    contexts: Sequence[Context], count: int, rng: np.random.Generator
) -> dict[str, np.ndarray]:
    """Positions (R, n, 50, 3 + 2 k) of the rollouts, by kind. n is ``count``, but 1 of ``still``.

    - ``good``: the expert, to places so near to the goal that it succeeds;
    - ``still``: nothing moves;
    - ``left_behind``: the arm as in a good one, and the objects stay where they are;
    - ``wrong_place``: the expert, to a place 5 to 30 cm from the goal. It ends at least 5 cm away;
    - ``stopped``: a good one until about half of the way, and then nothing moves;
    - ``other_goal``: the expert, to the goal that does not count, where there are two.
    """
    tolerance = load_task(contexts[0].task).tolerance
    nearly = in_disc(rng, _NEAR * tolerance, len(contexts) * count, np.zeros(2))
    nearly = nearly.reshape(len(contexts), count, 2)
    good, _ = _push_beside(contexts, nearly)
    left_behind = good.copy()
    left_behind[..., 3:] = good[:, :, :1, 3:]
    stopped = good.copy()
    for rollout in stopped.reshape(-1, *good.shape[2:]):
        step = rng.integers(*_HALF_WAY)
        rollout[step:] = rollout[step]
    rollouts = {
        GOOD: good,
        STILL: np.repeat(good[:, :1, :1], FRAMES, axis=2),
        LEFT_BEHIND: left_behind,
        WRONG_PLACE: _wrong_places(contexts, count, rng),
        STOPPED: stopped,
    }
    others = [
        context.choosing(colour)
        for context in contexts
        for colour in COLOURS
        if context.choice and context.choice.colour != colour
    ]
    return rollouts | ({OTHER_GOAL: _push_beside(others, nearly)[0]} if others else {})


def final_distances(contexts: Sequence[Context], positions: np.ndarray) -> np.ndarray:
    """Metres (R, n) that are left to each context's goal after ``positions`` (R, n, 50, 3 + 2 k)."""
    task = load_task(contexts[0].task)
    goals = np.repeat([context.goal_xy for context in contexts], positions.shape[1], axis=0)
    return task.distance(positions.reshape(-1, *positions.shape[2:]), goals).reshape(positions.shape[:2])


def _wrong_places(contexts: Sequence[Context], count: int, rng: np.random.Generator) -> np.ndarray:
    shape = len(contexts), _TRIES * count
    beside = rng.uniform(*_WRONG, (*shape, 1)) * unit_vector(rng.uniform(-np.pi, np.pi, shape))
    positions, distances = _push_beside(contexts, beside)
    chosen = np.argsort(distances < _WRONG[0], axis=1, kind="stable")[:, :count]
    return np.take_along_axis(positions, chosen[..., None, None], axis=1)


def _push_beside(contexts: Sequence[Context], beside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The expert's pushes to places ``beside`` (R, n, 2) the goals: positions, and distances to the goals."""
    targets = [
        replace(context, goal_xy=(float(context.goal_xy[0] + x), float(context.goal_xy[1] + y)))
        for context, places in zip(contexts, beside, strict=True)
        for x, y in places
    ]
    positions, _ = roll_out(targets)
    positions = positions.reshape(*beside.shape[:2], *positions.shape[1:])
    return positions, final_distances(contexts, positions)
