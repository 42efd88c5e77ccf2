"""Episodes step by step against the batch that they move."""

import numpy as np
import pytest

from anyview.pusher.batch import PusherBatch
from anyview.pusher.contexts import Context
from anyview.pusher.episodes import Moment, episode, film


@pytest.fixture
def actions() -> np.ndarray:
    return np.random.default_rng(0).uniform(-1, 1, (49, 2, 3))


def test_moments_are_those_of_the_steps_one_by_one(contexts: list[Context], actions: np.ndarray) -> None:
    moved, alone = PusherBatch(contexts[:2]), PusherBatch(contexts[:2])
    asked = []

    def act(now: Moment) -> np.ndarray:
        asked.append(now.step)
        return actions[now.step]

    expected = alone.reset()
    for step, now in enumerate(episode(moved, act)):
        if step:
            expected = alone.step(actions[step - 1])
            np.testing.assert_array_equal(now.actions, actions[step - 1])
        assert now.step == step == len(asked)
        np.testing.assert_array_equal(now.observations, expected)
        np.testing.assert_array_equal(moved.positions(), alone.positions())
    assert asked == list(range(49))


def test_a_film_shows_the_start_and_every_step(contexts: list[Context], actions: np.ndarray) -> None:
    moved, alone = PusherBatch(contexts[:2], image_size=32), PusherBatch(contexts[:2], image_size=32)
    for _ in range(2):  # a batch can act again
        frames = film(moved, lambda now: actions[now.step])
        alone.reset()
        assert frames.shape == (2, 50, 32, 32, 3)
        np.testing.assert_array_equal(frames[:, 0], alone.render())
        for step in range(49):
            alone.step(actions[step])
            np.testing.assert_array_equal(frames[:, step + 1], alone.render())
