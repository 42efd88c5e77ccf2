"""From a cell of ``params.yaml`` to what it trains with: its learner and its reward.

Each is imported when it is built, so that a cell depends on its own code alone.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anyview.config import ImitationCell, Params
from anyview.evaluation.demonstrations import training_clips
from anyview.learners.common.interfaces import Learner, RewardSource
from anyview.pusher.batch import ACTION_SIZE, ACTIONS, OBSERVATION_SIZE
from anyview.pusher.contexts import Context
from anyview.runtime.device import torch_device
from anyview.runtime.errors import AnyviewError
from anyview.seeds import stream

_BYSTANDERS = 100  # clips of random motion for TPIL


@dataclass(frozen=True)
class Group:
    """Runs that train in lockstep. R runs, m demonstrations; frames are uint8 RGB."""

    params: Params
    cell: ImitationCell
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


def make_reward(group: Group) -> Scoring:
    """The cell's reward, untrained where it learns."""
    return _REWARDS[group.cell.reward](group)


def _demonstrated(group: Group) -> Scoring:
    """The translated demonstration's reward, or the Oracle's against the true one."""
    from anyview.rewards.demonstration import (
        DemonstrationReward,
        translate_demonstrations,
        true_demonstrations,
    )
    from anyview.translator.weights import load_translator

    folder, size = Path(group.cell.source), group.params.sim.image_size
    model = load_translator(folder).to(torch_device())
    if model.image_size != size:
        raise AnyviewError(
            f"{folder}: for frames of {model.image_size} pixels, but sim.image_size is {size}; train it again"
        )
    first = np.ascontiguousarray(group.own[:, 0])
    if group.cell.reward == "true":
        targets = true_demonstrations(model, group.own)
    else:
        targets = translate_demonstrations(model, group.demonstrations, first)
    params = group.params.imitation.reward
    reward = DemonstrationReward(model, *targets, first, params, group.cell.feature, group.cell.image)
    return Scoring(reward, reward.units, reward.targets(), judges=True)


def _embedded(group: Group) -> Scoring:
    """The distance to the demonstrations in a time-contrastive embedding, which nothing translates."""
    from anyview.embedding.weights import load_embedding
    from anyview.rewards.embedding import EmbeddingReward

    folder, size = Path(group.cell.source), group.params.sim.image_size
    model = load_embedding(folder).to(torch_device())
    if model.image_size != size:
        raise AnyviewError(
            f"{folder}: for frames of {model.image_size} pixels, but sim.image_size is {size}; train it again"
        )
    reward = EmbeddingReward(model, group.demonstrations, group.own[:, 0], group.params.imitation.reward)
    return Scoring(reward, reward.units, _first_demonstration(group), judges=True)


def _gail(group: Group) -> Scoring:
    """GAIL against the training split's clips, each in a context of its own."""
    from anyview.adversarial.discriminators import ClipSet
    from anyview.adversarial.gail import gail_reward

    frames, rows, _ = training_clips(group.params)
    params, runs = group.params.imitation, group.runs
    experts = [ClipSet(frames, rows)] * len(runs)
    reward = gail_reward(
        params.discriminator, group.params.base.seed, runs, experts, params.trpo.batch_episodes
    )
    return Scoring(reward, np.ones(len(runs)), _first_demonstration(group), judges=False)


def _tpil(group: Group) -> Scoring:
    """TPIL against the same clips, and random motion in the contexts of some of them."""
    from anyview.adversarial.discriminators import ClipSet
    from anyview.adversarial.tpil import random_motion, tpil_reward

    frames, rows, contexts = training_clips(group.params)
    params, runs, seed = group.params.imitation, group.runs, group.params.base.seed
    rng = stream(seed, "bystanders")
    chosen = rng.permutation(len(contexts))[:_BYSTANDERS]
    sim = group.params.sim
    motion = random_motion(
        [contexts[index] for index in chosen], rng, params.trpo.initial_std, sim.control, sim.image_size
    )
    experts = [ClipSet(frames, rows)] * len(runs)
    bystanders = [ClipSet(motion, np.arange(len(motion)))] * len(runs)
    reward = tpil_reward(params.discriminator, seed, runs, experts, bystanders, params.trpo.batch_episodes)
    return Scoring(reward, np.ones(len(runs)), _first_demonstration(group), judges=False)


def _first_demonstration(group: Group) -> np.ndarray:
    """One of the clips that are shown, beside every run (R, 50, H, W, 3)."""
    return np.repeat(group.demonstrations[:1], len(group.runs), axis=0)


_REWARDS: dict[str, Callable[[Group], Scoring]] = {
    "translated": _demonstrated,
    "true": _demonstrated,
    "embedding": _embedded,
    "gail": _gail,
    "tpil": _tpil,
}
