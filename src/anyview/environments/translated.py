"""The task with the translated demonstration's reward, as a plain Gymnasium environment for any learner."""

from typing import Any

import gymnasium as gym
import numpy as np

from anyview.config import RewardWeights
from anyview.rewards.demonstration import DemonstrationReward, translate_demonstrations
from anyview.translator.architectures import Translator


class TranslatedReward(gym.Wrapper):
    """Replaces the reward of ``env`` by the translated demonstration's, from what ``env.render()`` shows.

    ``env`` is a ``PusherEnv`` with ``render_mode="rgb_array"``. Time is part of its observation and nothing
    follows the last step, which therefore terminates the episode. ``demonstrations`` (m, 50, H, W, 3) are
    uint8. They are translated at a reset whose first frame is new: once, where the context is fixed.
    """

    def __init__(
        self,
        env: gym.Env,
        model: Translator,
        demonstrations: np.ndarray,
        weights: RewardWeights,
        time_power: float = 0.0,
    ):
        super().__init__(env)
        self._model, self._demonstrations = model, demonstrations
        self._weights, self._time_power = weights, time_power
        self._first: np.ndarray | None = None
        self._steps = 0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Start an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        first = self._see()
        if self._first is None or not np.array_equal(first, self._first):
            targets = translate_demonstrations(self._model, self._demonstrations, first[None])
            self._reward = DemonstrationReward(
                self._model, *targets, first[None], self._weights, self._time_power
            )
            self._first = first
        self._steps = 0
        return observation, info

    def step(self, action: np.ndarray):
        """Act for 0.1 s; standing still would earn -1 a step on average."""
        observation, _, _, last, info = self.env.step(action)
        self._steps += 1
        reward = float(self._reward.step(self._see()[None, None], self._steps)[0, 0])
        return observation, reward, last, False, info

    def _see(self) -> np.ndarray:
        frame = self.env.render()
        assert isinstance(frame, np.ndarray), 'the environment needs render_mode="rgb_array"'
        return frame
