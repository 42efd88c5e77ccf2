"""Exploration noise: the Ornstein-Uhlenbeck process (Uhlenbeck and Ornstein 1930; Lillicrap et al. 2016)."""

import numpy as np


def ornstein_uhlenbeck(
    rng: np.random.Generator, steps: int, shape: tuple[int, ...], theta: float
) -> np.ndarray:
    """A stationary path (steps, *shape): x' = (1 - theta) x + sqrt(1 - (1 - theta)^2) N(0, 1).

    It has unit variance. Steps apart by k correlate by (1 - theta)^k: ``theta`` 1 is white noise.
    """
    normal = rng.standard_normal((steps, *shape))
    keep = 1 - theta
    path = np.empty_like(normal)
    path[0] = normal[0]
    for step in range(1, steps):
        path[step] = keep * path[step - 1] + np.sqrt(1 - keep**2) * normal[step]
    return path
