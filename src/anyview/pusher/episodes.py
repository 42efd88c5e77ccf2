"""Episodes of many pushers side by side: the one loop that rolls a policy out."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from anyview.pusher.batch import ACTION_SIZE, ACTIONS, PusherBatch


class Moment(NamedTuple):
    """Where N pushers stand after action ``step``; step 0 is the start."""

    step: int
    observations: np.ndarray
    """(N, O), as ``PusherBatch.observations`` has them."""
    actions: np.ndarray
    """The actions (N, 3) that led here; zeros at the start."""


Act = Callable[[Moment], np.ndarray]


def episode(batch: PusherBatch, act: Act) -> Iterator[Moment]:
    """Reset ``batch`` and take the ``ACTIONS`` steps of an episode with the actions (N, 3) of ``act``.

    Yields the start and the moment after each action. Meanwhile ``batch`` stands at that moment: it can be
    asked for frames, positions and distances.
    """
    now = Moment(0, batch.reset(), np.zeros((batch.count, ACTION_SIZE)))
    yield now
    while now.step < ACTIONS:
        actions = act(now)
        now = Moment(now.step + 1, batch.step(actions), actions)
        yield now


def film(batch: PusherBatch, act: Act) -> np.ndarray:
    """Frames (N, 50, H, W, 3) of an episode."""
    return np.stack([batch.render() for _ in episode(batch, act)], axis=1)
