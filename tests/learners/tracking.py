"""A tiny analytic task of the pusher's shape: a point that follows a path of its own in 49 steps."""

import numpy as np

from anyview.learners.common.interfaces import Learner
from anyview.seeds import stream

OBSERVATION, ACTION, HORIZON = 5, 2, 49


class Tracking:
    """R points in the plane, C copies of each. The path of row r depends on ``runs[r]`` alone.

    An action sets half of the velocity, at most 0.1 a step; the reward falls with the distance to the path.
    """

    def __init__(self, runs: list[int], copies: int = 1):
        self.shape = (len(runs), copies)
        progress = np.linspace(0, 1, HORIZON + 1)[:, None]
        draws = np.stack([stream(0, "path", run).normal(0, (0.5, 0.25), (2, 2)) for run in runs])
        straight, bend = draws[:, None, :, 0], draws[:, None, :, 1]
        self.path = straight * progress + bend * np.sin(np.pi * progress)

    def reset(self) -> np.ndarray:
        self.position = np.zeros((*self.shape, 2))
        self.velocity = np.zeros((*self.shape, 2))
        self.steps = 0
        return self._observe()

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        self.velocity = 0.5 * self.velocity + 0.05 * actions
        self.position = self.position + self.velocity
        self.steps += 1
        return self._observe(), -np.minimum(self.distance() / 0.2, 2.0)

    def distance(self) -> np.ndarray:
        return np.linalg.norm(self.position - self.path[:, None, self.steps], axis=-1)

    def _observe(self) -> np.ndarray:
        time = np.full((*self.shape, 1), 2 * self.steps / HORIZON - 1)
        return np.concatenate([self.position, 4 * self.velocity, time], axis=-1).astype(np.float32)


def practise(learner: Learner, world: Tracking, iterations: int) -> None:
    """Train for ``iterations``."""
    for _ in range(iterations):
        observations = world.reset()
        for step in range(1, HORIZON + 1):
            actions = learner.act(observations, explore=True)
            next_observations, rewards = world.step(actions)
            learner.record(observations, actions, rewards, next_observations, step)
            observations = next_observations
        learner.end_iteration()


def practise_rescored(learner: Learner, world: Tracking, iterations: int, memory: int) -> None:
    """As ``practise``, but rewards become known with the episode's end, of the newest ``memory`` episodes."""
    known = np.zeros((world.shape[0], 0, HORIZON), np.float32)
    for _ in range(iterations):
        observations, earned = world.reset(), []
        for step in range(1, HORIZON + 1):
            actions = learner.act(observations, explore=True)
            next_observations, rewards = world.step(actions)
            learner.record(observations, actions, np.zeros_like(rewards), next_observations, step)
            observations = next_observations
            earned.append(rewards)
        known = np.concatenate([known, np.stack(earned, axis=-1)], axis=1)[:, -memory:].astype(np.float32)
        learner.end_iteration(known)


def mean_distance(learner: Learner, world: Tracking) -> np.ndarray:
    """Mean distance (R,) to the path over an episode without noise."""
    observations, distances = world.reset(), []
    for _ in range(HORIZON):
        observations, _ = world.step(learner.act(observations, explore=False))
        distances.append(world.distance().mean(1))
    return np.mean(distances, axis=0)
