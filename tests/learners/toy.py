"""Toy clips of a square on a ground of one grey: 16x16 pixels, T = 8 actions."""

import numpy as np

from anyview import config
from anyview.adversarial.common.discriminators import ClipSet, LearnedReward

SIZE, LAST = 16, 8
PARAMS = config.Discriminator(
    batch_size=16,
    learning_rate=0.003,
    steps=10,
    memory=6,
    rescored=4,
    gradient_penalty=0.0,
    halved=True,
    shift=0,
    domain_weight=0.2,
)


def squares(columns: np.ndarray, ground: int = 40) -> np.ndarray:
    """Clips (N, T + 1, 16, 16, 3) of a white square whose left edge is at ``columns`` (N, T + 1), 0 to 12."""
    places = np.arange(SIZE)
    inside = (places >= columns[..., None]) & (places < columns[..., None] + 4)
    clips = np.full((*columns.shape, SIZE, SIZE, 3), ground, np.uint8)
    clips[:, :, 6:10][np.broadcast_to(inside[:, :, None], (*columns.shape, 4, SIZE))] = 255
    return clips


def expert_motion(count: int) -> np.ndarray:
    """The square goes from left to right: columns (count, T + 1)."""
    return np.broadcast_to(np.linspace(0, 12, LAST + 1), (count, LAST + 1))


def random_motion(count: int, seed: int) -> np.ndarray:
    """The square jumps about: columns (count, T + 1)."""
    return np.random.default_rng(seed).integers(0, 13, (count, LAST + 1))


def clip_set(clips: np.ndarray) -> ClipSet:
    return ClipSet(clips, np.arange(len(clips)))


def show(reward: LearnedReward, clips: np.ndarray) -> np.ndarray:
    """Rewards (R, C, T) of an iteration in which the agents' cameras see ``clips`` (R, C, T + 1, ...)."""
    steps = [reward.step(np.ascontiguousarray(clips[:, :, t]), t) for t in range(1, LAST + 1)]
    return np.stack(steps, axis=-1)
