"""A group of runs that train in lockstep, and from its cell of ``params.yaml`` to its learner.

A learner is imported when it is built, so that a cell depends on the code of its own alone. Rewards are made
by ``rewards.cells`` and by the modules of ``adversarial``.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from anyview.config import AdversarialCell, ImitationCell, Params
from anyview.learners.common.interfaces import Learner, RewardSource
from anyview.pusher.batch import ACTION_SIZE, ACTIONS, OBSERVATION_SIZE
from anyview.pusher.contexts import Context
from anyview.runtime.device import torch_device


@dataclass(frozen=True)
class Group:
    """Runs that train in lockstep. R runs, m demonstrations; frames are uint8 RGB."""

    params: Params
    cell: ImitationCell | AdversarialCell
    runs: Sequence[int]
    contexts: Sequence[Context]
    demonstrations: np.ndarray
    """(m, 50, H, W, 3), what the agents are shown: the expert in other contexts."""
    own: np.ndarray
    """(R, 50, H, W, 3), the expert in each agent's own view: from the agent's first frame on."""


@dataclass(frozen=True)
class Scoring:
    """A reward and how to report it: returns times ``units`` (R,) are in its equations' own units.

    ``shown`` (R, 50, H, W, 3) is the demonstration that each run imitates, as the reward sees it. ``judges``
    says whether the reward can score any motion before training, for the return table.
    """

    reward: RewardSource
    units: np.ndarray
    shown: np.ndarray
    judges: bool


MakeReward = Callable[[Group], Scoring]
"""Makes a cell's reward, untrained where it learns."""


def first_demonstration(group: Group) -> np.ndarray:
    """One of the clips that are shown, beside every run (R, 50, H, W, 3)."""
    return np.repeat(group.demonstrations[:1], len(group.runs), axis=0)


def make_learner(group: Group) -> Learner:
    """The cell's learner, untrained."""
    params = group.params.imitation
    seed = group.params.base.seed
    if group.cell.learner == "trpo":
        from anyview.learners.trpo import TRPO

        return TRPO(params.trpo, seed, group.runs, OBSERVATION_SIZE, ACTION_SIZE, ACTIONS)
    from anyview.learners.ddpg import DDPG

    return DDPG(
        params.ddpg,
        seed,
        group.runs,
        OBSERVATION_SIZE,
        ACTION_SIZE,
        horizon=ACTIONS,
        copies=params.episodes_per_iteration,
        iterations=params.iterations,
        device=torch_device(),
    )
