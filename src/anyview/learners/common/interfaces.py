"""What the evaluation asks of a learner and of a reward.

R runs act in lockstep, in C copies of each run's context.
"""

from typing import Protocol

import numpy as np

Arrays = dict[str, np.ndarray]


class Learner(Protocol):
    """R independent policies that learn side by side. Row r depends on run r's own seed and data alone."""

    def act(self, observations: np.ndarray, explore: bool) -> np.ndarray:
        """Actions (R, C, A) in [-1, 1] for ``observations`` (R, C, O); with noise where ``explore``."""
        ...

    def record(
        self,
        observations: np.ndarray,
        actions: np.ndarray,
        rewards: np.ndarray,
        next_observations: np.ndarray,
        step: int,
    ) -> None:
        """Take the transition of ``step`` (1 to 49; 49 ends the episode).

        Shapes (R, C, O), (R, C, A), (R, C) and (R, C, O).
        """
        ...

    def end_iteration(self, rescored: np.ndarray | None = None) -> None:
        """All episodes of an iteration have ended.

        ``rescored`` (R, E, T), where what was recorded does not stand, are the rewards of the newest E
        episodes, the oldest first. They replace it.
        """
        ...

    def policy(self) -> Arrays:
        """Weights of the deterministic policies, each with a leading dimension R."""
        ...

    def state(self) -> Arrays:
        """Everything that a resumed training needs (weights, optimiser, replay, noise, generators)."""
        ...

    def restore(self, state: Arrays) -> None:
        """Continue from ``state()`` bit for bit."""
        ...


class RewardSource(Protocol):
    """Scores what the agents' cameras see. Made once per group of runs, from the runs' first frames."""

    def step(self, frames: np.ndarray, step: int) -> np.ndarray:
        """Rewards (R, C) of uint8 ``frames`` (R, C, H, W, 3) seen after action ``step`` (1 to 49)."""
        ...

    def end_iteration(self) -> Arrays:
        """Learn from the iteration's frames where the reward is learned; measures (R,) to log by name."""
        ...

    def rescored(self) -> np.ndarray | None:
        """Rewards (R, E, T) of the newest E episodes, where ``step`` did not give what stands; or None.

        For a reward that has learned since, or knows an episode's rewards only when it has ended.
        """
        ...

    def state(self) -> Arrays:
        """Everything that a resumed training needs."""
        ...

    def restore(self, state: Arrays) -> None:
        """Continue from ``state()`` bit for bit."""
        ...
