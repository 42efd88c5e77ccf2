"""Uncertainty of an evaluation: 95% intervals (Wilson, bootstrap), exact paired tests, Holm's correction."""

from collections.abc import Callable

import numpy as np
from scipy import stats

Interval = tuple[float, float]

RESAMPLES = 10_000
_EXACT_WAYS = (
    50_000  # two samples of 9 can be dealt out in 48,620 ways; where there are more, so many are drawn
)
EXACT_PAIRS = 40
"""Up to so many pairs the sign-flip test counts every pattern of signs; beyond, it takes the normal limit."""


def wilson_interval(successes: int, trials: int) -> Interval:
    """Wilson's score interval of a proportion (Wilson, 1927): honest for few trials, and at 0 and 1."""
    result = stats.binomtest(successes, trials).proportion_ci(0.95, method="wilson")
    return float(result.low), float(result.high)


def crossed_error(values: np.ndarray) -> tuple[float, float]:
    """Standard error, and its degrees of freedom, of the mean of ``values`` (K, n) of K models in n contexts.

    Contexts are the same for all models, and both are draws: the squared error is s_K^2/K + s_n^2/n -
    s^2/(Kn), with the variances of models' means, of contexts' means and of what neither explains. The
    degrees are Satterthwaite's (1946). With one model it is of the contexts alone.
    """
    models, contexts = values.shape
    of_models, of_contexts = values.mean(axis=1), values.mean(axis=0)
    parts = [(of_contexts.var(ddof=1) / contexts, contexts - 1)]
    if models > 1:
        left = values - of_models[:, None] - of_contexts + values.mean()
        freedom = (models - 1) * (contexts - 1)
        unexplained = np.sum(left**2) / freedom / left.size
        parts += [(of_models.var(ddof=1) / models, models - 1), (-unexplained, freedom)]
    # Both means hold what neither explains, which counts once; the estimate of it may be too large.
    variance = max(sum(part for part, _ in parts), *(part for part, _ in parts))
    if variance == 0:
        return 0.0, contexts - 1.0
    freedom = variance**2 / sum(part**2 / freedom for part, freedom in parts)
    return float(np.sqrt(variance)), max(float(freedom), min(least for _, least in parts))


def crossed_interval(values: np.ndarray) -> Interval:
    """Student's interval of the mean of ``values`` (K, n), as ``crossed_error`` has its error."""
    error, freedom = crossed_error(values)
    reach = stats.t.ppf(0.975, freedom) * error
    return float(values.mean() - reach), float(values.mean() + reach)


def crossed_rate_interval(successes: np.ndarray) -> Interval:
    """Wilson's interval of the rate of ``successes`` (K, n) of K models in the same n contexts.

    Of as many trials as would have the error that ``crossed_error`` finds, as for clustered samples (Korn and
    Graubard, 1998), and never narrower towards 0 and 1 than n contexts that all agree would leave it.
    """
    rate, contexts = float(successes.mean()), successes.shape[1]
    error, freedom = crossed_error(np.asarray(successes, float))
    trials = min(rate * (1 - rate) / error**2, successes.size) if error > 0 else contexts
    z2 = stats.t.ppf(0.975, freedom) ** 2 / trials
    centre, reach = rate + z2 / 2, np.sqrt(z2 * (rate * (1 - rate) + z2 / 4))
    open_end = 1 / (1 + contexts / stats.t.ppf(0.975, contexts - 1) ** 2)
    low, high = (centre - reach) / (1 + z2), (centre + reach) / (1 + z2)
    return float(min(low, 1 - open_end)), float(max(high, open_end))


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


def sign_flip_test(differences: np.ndarray) -> float:
    """p-value of the two-sided sign-flip test (Fisher, 1935) of paired ``differences`` (n,).

    If a pair's two values might as well be exchanged, each of the 2^n patterns of signs is as likely as the
    one seen: p is the fraction of them whose sum is at least as far from 0. Exact up to ``EXACT_PAIRS``.
    """
    differences = np.asarray(differences, float)
    if len(differences) > EXACT_PAIRS:
        return float(2 * stats.norm.sf(abs(differences.sum()) / np.sqrt(np.sum(differences**2))))
    seen = abs(differences.sum()) - 1e-9 * np.abs(differences).sum()  # what equals it counts, in any order
    if seen <= 0:
        return 1.0
    first, second = (_signed_sums(half) for half in np.array_split(differences, 2))
    reached = len(second) - np.searchsorted(np.sort(second), seen - first)
    return float(2 * reached.sum() / 2 ** len(differences))


def exchange_test(first: np.ndarray, second: np.ndarray) -> float:
    """p-value of the two-sided exact permutation test of the means of two samples, (n,) and (m,).

    If it makes no difference from which sample a value is, every way of dealing them out is as likely.
    """
    found = stats.permutation_test(
        (first, second), _difference_of_means, n_resamples=_EXACT_WAYS, rng=np.random.default_rng(0)
    )
    return float(found.pvalue)


def _difference_of_means(first: np.ndarray, second: np.ndarray, axis: int) -> np.ndarray:
    return np.mean(first, axis=axis) - np.mean(second, axis=axis)


def _signed_sums(values: np.ndarray) -> np.ndarray:
    """The sums of ``values`` (n,) under every pattern of signs, (2^n,)."""
    sums = np.zeros(1)
    for value in values:
        sums = np.concatenate([sums + value, sums - value])
    return sums


def holm(p_values: np.ndarray) -> np.ndarray:
    """p-values (m,) corrected for being m (Holm, 1979): the chance that any is below 5% by luck is 5%."""
    p_values = np.asarray(p_values, float)
    order = np.argsort(p_values)
    corrected = np.maximum.accumulate(p_values[order] * np.arange(len(order), 0, -1)).clip(max=1)
    return corrected[np.argsort(order)]
