"""What a method is made of, and the group of runs that it trains in lockstep.

The modules of ``learners``, ``rewards`` and ``adversarial`` make learners and rewards; a stage puts them
together, so that it depends on the code of its own cells alone.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from anyview.config import AdversarialCell, GoalCell, ImitationCell, Params
from anyview.learners.common.interfaces import Learner, RewardSource
from anyview.pusher.contexts import Context


@dataclass(frozen=True)
class Group:
    """Runs that train in lockstep. R runs, m demonstrations; frames are uint8 RGB."""

    params: Params
    cell: ImitationCell | GoalCell | AdversarialCell
    runs: Sequence[int]
    contexts: Sequence[Context]
    demonstrations: np.ndarray
    """(m, 50, H, W, 3), what the agents are shown: the expert in other contexts.

    (R, m, 50, H, W, 3) where each run has clips of its own.
    """
    own: np.ndarray
    """(R, 50, H, W, 3), the expert in each agent's own view: from the agent's first frame on."""


@dataclass(frozen=True)
class Scoring:
    """A reward and how to report it: returns times ``scales`` (R,) are in its equations' own units.

    ``shown`` (R, 50, H, W, 3) is the demonstration that each run imitates, as the reward sees it. ``fixed``
    says that the reward does not learn: it can score any motion, for the return table.
    """

    reward: RewardSource
    scales: np.ndarray
    shown: np.ndarray
    fixed: bool


MakeLearner = Callable[[Params, Sequence[int], int], Learner]
"""From params, numbers of the runs and the size of an observation."""
MakeReward = Callable[[Group], Scoring]


class Method(NamedTuple):
    """How to make a cell's learner and its reward, both untrained."""

    make_learner: MakeLearner
    make_reward: MakeReward


def first_demonstration(group: Group) -> np.ndarray:
    """One of the clips that are shown, beside every run (R, 50, H, W, 3)."""
    return np.repeat(group.demonstrations[:1], len(group.runs), axis=0)
