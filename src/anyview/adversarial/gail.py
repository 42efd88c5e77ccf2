"""GAIL on images (Ho and Ermon 2016): a discriminator D of single frames and their time.

The reward is log D - log(1 - D), which has a slope on both sides, as Kostrikov et al. (2019) have it.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

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
from anyview.learners.common.policies import with_time_features

_CHANNELS = (16, 32, 32)
_WIDTH = 64
_TIME_FEATURES = 10
_LEAK = 0.2


class FrameDiscriminator(Discriminator):
    """D(o_t, t): three strided convolutions on the frame, ``halved`` or not; time joins the connected layer.

    Time comes as radial basis functions beside the number. From the number alone the discriminator learns
    many times slower that the same frame is the expert's at one time and not at another.
    """

    def __init__(self, image_size: int, halved: bool):
        super().__init__()
        layers: list[nn.Module] = [Halve()] if halved else []
        before, side = 3, image_size // 2 if halved else image_size
        for channels in _CHANNELS:
            layers += [nn.Conv2d(before, channels, 3, stride=2, padding=1), nn.LeakyReLU(_LEAK)]
            before, side = channels, -(-side // 2)
        self.features = nn.Sequential(*layers, nn.Flatten())
        self.hidden = nn.Linear(before * side**2 + 1 + _TIME_FEATURES, _WIDTH)
        self.output = nn.Linear(_WIDTH, 1)

    def score(self, before: Tensor, now: Tensor, time: Tensor) -> Tensor:
        """log D/(1 - D), (B,)."""
        inputs = torch.cat([now, with_time_features(2 * time[:, None] - 1, _TIME_FEATURES)], dim=1)
        return self.output(F.leaky_relu(self.hidden(inputs), _LEAK)).squeeze(1)

    def loss(self, views: Mapping[str, Views]) -> Tensor:
        """-E_expert[log D] - E_agent[log(1 - D)]."""
        return cross_entropy(self.logits(views["expert"]), 1.0) + cross_entropy(
            self.logits(views["agent"]), 0.0
        )


def gail_reward(
    params: config.Discriminator, seed: int, runs: Sequence[int], experts: Sequence[ClipSet]
) -> LearnedReward:
    """The reward of ``runs``, each with its set of expert clips."""
    size = experts[0].frames.shape[2]
    sets = [{"expert": clips} for clips in experts]
    return LearnedReward(lambda: FrameDiscriminator(size, params.halved), params, seed, runs, sets)


def make_reward(group: Group) -> Scoring:
    """The reward of ``group`` against the training split's clips, each in a context of its own."""
    frames, rows, _ = training_clips(group.params)
    params, runs = group.params, group.runs
    experts = [ClipSet(frames, rows)] * len(runs)
    reward = gail_reward(params.adversarial.discriminator, params.base.seed, runs, experts)
    return Scoring(reward, np.ones(len(runs)), first_demonstration(group), fixed=False)
