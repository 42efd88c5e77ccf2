"""Uncertainty of an evaluation: Wilson intervals, bootstrap intervals, exact McNemar tests. All at 95%."""

from collections.abc import Callable

import numpy as np
from scipy import stats

Interval = tuple[float, float]

RESAMPLES = 10_000


def wilson_interval(successes: int, trials: int) -> Interval:
    """Wilson's score interval of a proportion (Wilson, 1927): honest for few trials, and at 0 and 1."""
    result = stats.binomtest(successes, trials).proportion_ci(0.95, method="wilson")
    return float(result.low), float(result.high)


def resampled(values: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """``RESAMPLES`` draws with replacement of the rows of ``values`` (n, ...), as (RESAMPLES, n, ...)."""
    values = np.asarray(values)
    return values[rng.integers(len(values), size=(RESAMPLES, len(values)))]


def bootstrap_interval(
    values: np.ndarray, statistic: Callable[..., np.ndarray], rng: np.random.Generator
) -> Interval:
    """Percentile bootstrap interval of ``statistic`` over the rows of ``values`` (n, ...).

    ``statistic(draws, axis=1)`` takes (RESAMPLES, n, ...), as ``np.mean`` and ``np.median`` do. Give paired
    differences for a paired interval: both values of a pair are then drawn together.
    """
    return quantile_interval(statistic(resampled(values, rng), axis=1))


def quantile_interval(draws: np.ndarray) -> Interval:
    """The middle 95% of ``draws`` (RESAMPLES,)."""
    low, high = np.quantile(draws, [0.025, 0.975])
    return float(low), float(high)


def mcnemar_exact(first: np.ndarray, second: np.ndarray) -> float:
    """p-value of the two-sided exact McNemar test of paired successes (n,): only runs that differ count."""
    first, second = np.asarray(first, bool), np.asarray(second, bool)
    only_first, only_second = int((first & ~second).sum()), int((second & ~first).sum())
    if only_first + only_second == 0:
        return 1.0
    return float(stats.binomtest(only_first, only_first + only_second).pvalue)
