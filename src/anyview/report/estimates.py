"""Estimates with their 95% bounds, resampled from named streams, so that they repeat exactly."""

from dataclasses import dataclass

import numpy as np

from anyview.imitation.statistics import bootstrap_interval, quantile_interval, resampled, wilson_interval
from anyview.runtime.seeds import stream


@dataclass(frozen=True)
class Estimate:
    """A value and its 95% bounds."""

    value: float
    low: float
    high: float

    @property
    def excludes_zero(self) -> bool:
        """Whether the whole interval lies on one side of 0."""
        return self.low > 0 or self.high < 0


@dataclass(frozen=True)
class Estimator:
    """Bootstraps with streams derived from ``seed`` and from the name of what is estimated."""

    seed: int

    def mean(self, name: str, values: np.ndarray, groups: np.ndarray | None = None) -> Estimate:
        """Mean of ``values`` (n,); those of one group (``groups``: (n,)) are drawn together."""
        value = float(np.mean(values))
        if groups is None:
            return Estimate(value, *bootstrap_interval(values, np.mean, self._stream(name)))
        _, members = np.unique(groups, return_inverse=True)
        sums = np.stack([np.bincount(members, weights=values), np.bincount(members)], axis=1)
        return Estimate(value, *bootstrap_interval(sums, _mean_of_sums, self._stream(name)))

    def median(self, name: str, values: np.ndarray) -> Estimate:
        """Median of ``values`` (n,)."""
        return Estimate(float(np.median(values)), *bootstrap_interval(values, np.median, self._stream(name)))

    def ratio_of_means(self, name: str, above: np.ndarray, below: np.ndarray) -> Estimate:
        """mean(above) / mean(below) of two independent samples."""
        rng = self._stream(name)
        draws = resampled(above, rng).mean(axis=1) / resampled(below, rng).mean(axis=1)
        return Estimate(float(np.mean(above) / np.mean(below)), *quantile_interval(draws))

    def _stream(self, name: str) -> np.random.Generator:
        return stream(self.seed, f"bootstrap/{name}")


def proportion(successes: int, trials: int) -> Estimate:
    """Successes of trials, with Wilson bounds."""
    return Estimate(successes / trials, *wilson_interval(successes, trials))


def _mean_of_sums(draws: np.ndarray, axis: int) -> np.ndarray:
    """Means of draws (RESAMPLES, groups, 2) of (sum, count)."""
    totals = draws.sum(axis=axis)
    return totals[..., 0] / totals[..., 1]
