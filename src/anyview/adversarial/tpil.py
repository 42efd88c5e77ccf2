"""Third-person imitation (Stadie et al. 2017): is it the expert's motion, whichever view it is seen from?

Features of a frame serve two heads: the class head tells expert from not, on a pair of frames; the domain
head tells the expert's view from the agent's, on one frame, and its gradient is reversed on its way into the
features. The view must not give the class away. So there is a third set, the "bystander": pushes to wrong
places in the expert's views. The paper's words for the three sets are expert, novice (here the agent) and
random policy in the expert's domain (here the bystander). Random actions hardly move the object: then the
class head has to see no more than that it moves.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from anyview import config
from anyview.adversarial.common.discriminators import (
    ClipSet,
    Discriminator,
    Halve,
    LearnedReward,
    Views,
    cross_entropy,
)
from anyview.evaluation.demonstrations import training_clips
from anyview.evaluation.methods import Group, Scoring, first_demonstration
from anyview.pusher.contexts import Context, sample_contexts
from anyview.pusher.expert import roll_out
from anyview.pusher.render import renderer
from anyview.seeds import stream

_CHANNELS = 5
_WIDTH = 128
_LEAK = 0.2
_BYSTANDERS = 100  # clips of wrong pushes


class ReverseGradient(torch.autograd.Function):
    """The identity, whose gradient is multiplied by -``weight`` (Ganin and Lempitsky 2015)."""

    @staticmethod
    def forward(ctx: Any, x: Tensor, weight: float) -> Tensor:
        ctx.weight = weight
        return x.view_as(x)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None]:
        return -ctx.weight * gradient, None


class PairDiscriminator(Discriminator):
    """Two 3x3 convolutions of 5 channels, each with 2x2 pooling; heads with one connected layer of 128.

    The paper has frames of 50 pixels; they are ``halved`` or not, as in ``gail``.
    """

    lag = 3

    def __init__(self, image_size: int, halved: bool, domain_weight: float):
        super().__init__()
        self._domain_weight = domain_weight
        self.features = nn.Sequential(
            *([Halve()] if halved else []),
            nn.Conv2d(3, _CHANNELS, 3, padding=1),
            nn.MaxPool2d(2),
            nn.LeakyReLU(_LEAK),
            nn.Conv2d(_CHANNELS, _CHANNELS, 3, padding=1),
            nn.MaxPool2d(2),
            nn.LeakyReLU(_LEAK),
            nn.Flatten(),
        )
        size = _CHANNELS * (image_size // (8 if halved else 4)) ** 2
        self.class_head = _head(2 * size)
        self.domain_head = _head(size)

    def score(self, before: Tensor, now: Tensor, time: Tensor) -> Tensor:
        """log P(expert)/P(not expert), (B,)."""
        return self.class_head(torch.cat([before, now], dim=1)).squeeze(1)

    def loss(self, views: Mapping[str, Views]) -> Tensor:
        """Cross-entropy of both heads; in each, both labels weigh the same."""
        before = {name: self.features(batch.before) for name, batch in views.items()}
        now = {name: self.features(batch.now) for name, batch in views.items()}
        classes = {name: self.score(before[name], now[name], batch.time) for name, batch in views.items()}
        domains = {name: self._domain(features) for name, features in now.items()}
        not_expert = cross_entropy(torch.cat([classes["agent"], classes["bystander"]]), 0.0)
        expert_view = cross_entropy(torch.cat([domains["expert"], domains["bystander"]]), 1.0)
        return (
            cross_entropy(classes["expert"], 1.0)
            + not_expert
            + expert_view
            + cross_entropy(domains["agent"], 0.0)
        )

    def accuracies(self, views: Mapping[str, Views]) -> dict[str, Tensor]:
        """Of the class head by set, and of the domain head with both domains weighing the same."""
        told = {
            name: ((self._domain(self.features(batch.now)) > 0) == (name != "agent")).float().mean()
            for name, batch in views.items()
        }
        expert_view = (told["expert"] + told["bystander"]) / 2
        return super().accuracies(views) | {"domain_accuracy": (expert_view + told["agent"]) / 2}

    def _domain(self, features: Tensor) -> Tensor:
        """log P(expert's view)/P(agent's view), (B,)."""
        return self.domain_head(ReverseGradient.apply(features, self._domain_weight)).squeeze(1)


def _head(inputs: int) -> nn.Sequential:
    return nn.Sequential(nn.Linear(inputs, _WIDTH), nn.LeakyReLU(_LEAK), nn.Linear(_WIDTH, 1))


def tpil_reward(
    params: config.Discriminator,
    seed: int,
    runs: Sequence[int],
    experts: Sequence[ClipSet],
    bystanders: Sequence[ClipSet],
) -> LearnedReward:
    """The reward of ``runs``, each with expert and bystander clips."""
    size = experts[0].frames.shape[2]
    sets = [
        {"expert": expert, "bystander": bystander}
        for expert, bystander in zip(experts, bystanders, strict=True)
    ]

    def make() -> PairDiscriminator:
        return PairDiscriminator(size, params.halved, params.domain_weight)

    return LearnedReward(make, params, seed, runs, sets)


def wrong_pushes(contexts: Sequence[Context], rng: np.random.Generator, image_size: int) -> np.ndarray:
    """Clips (N, T + 1, H, W, 3), one in each context, of the expert's motion to other goals than is seen.

    Where the arm does not reach one, the push ends on the way.
    """
    others, _ = sample_contexts(rng, len(contexts), task=contexts[0].task)
    positions, _ = roll_out(
        [replace(context, goal_xy=other.goal_xy) for context, other in zip(contexts, others, strict=True)]
    )
    camera = renderer(contexts[0].task, image_size)
    return np.stack([camera.render_clip(*each) for each in zip(contexts, positions, strict=True)])


def make_reward(group: Group) -> Scoring:
    """The reward of ``group`` against the same clips as GAIL, and wrong pushes in the contexts of some."""
    frames, rows, contexts = training_clips(group.params)
    params, runs = group.params, group.runs
    rng = stream(params.base.seed, "bystanders")
    chosen = [contexts[index] for index in rng.permutation(len(contexts))[:_BYSTANDERS]]
    pushes = wrong_pushes(chosen, rng, params.sim.image_size)
    experts = [ClipSet(frames, rows)] * len(runs)
    bystanders = [ClipSet(pushes, np.arange(len(pushes)))] * len(runs)
    discriminator, seed = params.adversarial.discriminator, params.base.seed
    reward = tpil_reward(discriminator, seed, runs, experts, bystanders)
    return Scoring(reward, np.ones(len(runs)), first_demonstration(group), fixed=False)
