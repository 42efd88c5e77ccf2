"""From a cell of ``imitation.cells`` to its reward."""

from typing import TypeVar

import numpy as np

from anyview import paths
from anyview.config import DemonstrationCell, EmbeddingRewardCell, GoalCell
from anyview.embedding.network import Embedding
from anyview.embedding.weights import load_embedding
from anyview.evaluation.methods import Group, Scoring, first_demonstration
from anyview.rewards.demonstration import (
    DemonstrationReward,
    frames_there,
    hold,
    translate_clock,
    translate_demonstrations,
    translate_each,
    true_demonstrations,
)
from anyview.rewards.embedding import EmbeddingReward
from anyview.rewards.goal import GoalReward
from anyview.rewards.transport import TransportReward
from anyview.runtime.device import torch_device
from anyview.runtime.errors import AnyviewError
from anyview.translator.architectures import Translator
from anyview.translator.weights import load_translator

Model = TypeVar("Model", Translator, Embedding)


def make_reward(group: Group) -> Scoring:
    """The cell's reward. Raises AnyviewError if its model was trained on frames of another size."""
    if isinstance(group.cell, EmbeddingRewardCell):
        return _embedded(group, group.cell)
    if isinstance(group.cell, GoalCell):
        return _ending(group, group.cell)
    assert isinstance(group.cell, DemonstrationCell)
    return _demonstrated(group, group.cell)


def _demonstrated(group: Group, cell: DemonstrationCell) -> Scoring:
    """The translated demonstration's reward, or the Oracle's against the true one."""
    model = _fitting(load_translator(paths.model(cell.model)), cell.model, group.params.sim.image_size)
    first = np.ascontiguousarray(group.own[:, 0])
    if cell.matching == "transport":
        each = translate_each(model, group.demonstrations, first)
        transport = TransportReward(model, *each, first, cell.weights)
        return Scoring(transport, transport.scales, transport.targets(), fixed=True)
    there = frames_there(group.own.shape[1], cell.incomplete)
    if cell.reward == "true":
        targets = true_demonstrations(model, group.own)
    else:
        translate = translate_clock if cell.reward == "clock" else translate_demonstrations
        targets = translate(model, hold(group.demonstrations, there), first)
    reward = DemonstrationReward(model, *targets, first, cell.weights, cell.time_power, there)
    return Scoring(reward, reward.scales, reward.targets(), fixed=True)


def _embedded(group: Group, cell: EmbeddingRewardCell) -> Scoring:
    """The distance to the demonstrations in a time-contrastive embedding, which nothing translates."""
    model = _fitting(load_embedding(paths.model(cell.model)), cell.model, group.params.sim.image_size)
    reward = EmbeddingReward(model, group.demonstrations, group.own[:, 0], cell.time_power)
    return Scoring(reward, reward.scales, first_demonstration(group), fixed=True)


def _ending(group: Group, cell: GoalCell) -> Scoring:
    """The distance to how demonstrations end, in an embedding by cycles."""
    model = _fitting(load_embedding(paths.model(cell.model)), cell.model, group.params.sim.image_size)
    reward = GoalReward(model, group.demonstrations, group.own[:, 0])
    return Scoring(reward, reward.scales, first_demonstration(group), fixed=True)


def _fitting(model: Model, name: str, size: int) -> Model:
    if model.image_size != size:
        raise AnyviewError(
            f"{paths.model(name)}: for frames of {model.image_size} pixels, but sim.image_size is {size}; "
            "train it again"
        )
    return model.to(torch_device())
