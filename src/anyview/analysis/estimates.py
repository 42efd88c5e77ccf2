"""Estimates with their 95% bounds; what is resampled is so from named streams, so that it repeats exactly."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from anyview.analysis import thesis
from anyview.analysis.statistics import (
    bootstrap_interval,
    crossed_interval,
    crossed_rate_interval,
    quantile_interval,
    resampled,
    wilson_interval,
)
from anyview.seeds import stream


@dataclass(frozen=True)
class Estimate:
    """A value and its 95% bounds."""

    value: float
    low: float
    high: float

    def exponential(self) -> "Estimate":
        """e to the power of value and bounds: a difference of logarithms as a ratio."""
        return Estimate(math.exp(self.value), math.exp(self.low), math.exp(self.high))


@dataclass(frozen=True)
class Estimator:
    """Bootstraps with streams derived from ``seed`` and from the name of what is estimated."""

    seed: int

    def mean(self, name: str, values: np.ndarray, groups: np.ndarray | None = None) -> Estimate:
        """Mean of ``values`` (n,); those of one group (``groups``: (n,)) are drawn together."""
        sums = _sums(values, groups)
        return Estimate(float(np.mean(values)), *bootstrap_interval(sums, _ratio_of_sums, self._stream(name)))

    def median(self, name: str, values: np.ndarray) -> Estimate:
        """Median of ``values`` (n,)."""
        return Estimate(float(np.median(values)), *bootstrap_interval(values, np.median, self._stream(name)))

    def ratio_of_means(
        self,
        name: str,
        above: np.ndarray,
        below: np.ndarray,
        groups: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> Estimate:
        """mean(above) / mean(below) of two independent samples; ``groups`` of each as in ``mean``."""
        rng = self._stream(name)
        samples = zip((above, below), groups or (None, None), strict=True)
        means = [_ratio_of_sums(resampled(_sums(*sample), rng), axis=1) for sample in samples]
        return Estimate(float(np.mean(above) / np.mean(below)), *quantile_interval(means[0] / means[1]))

    def change_of_ratio(
        self, name: str, above: np.ndarray, below: np.ndarray, groups: tuple[np.ndarray, np.ndarray]
    ) -> Estimate:
        """mean(above) / mean(below) of a second way minus that of a first, measured on the same two samples.

        ``above`` (n, 2) and ``below`` (m, 2) hold both ways' values of a member, which are drawn together.
        """
        rng = self._stream(name)
        means = []
        for values, members in zip((above, below), groups, strict=True):
            ways = np.concatenate([_sums(column, members) for column in values.T], axis=1)  # sum, count twice
            totals = resampled(ways, rng).sum(axis=1)
            means.append(totals[:, [0, 2]] / totals[:, [1, 3]])
        ratios = means[0] / means[1]
        measured = above.mean(axis=0) / below.mean(axis=0)
        return Estimate(float(measured[1] - measured[0]), *quantile_interval(ratios[:, 1] - ratios[:, 0]))

    def share(self, name: str, part: np.ndarray, whole: np.ndarray) -> Estimate:
        """mean(part) / mean(whole) of pairs (n,), which are drawn together."""
        pairs = np.stack([part, whole], axis=1)
        return Estimate(
            float(np.mean(part) / np.mean(whole)),
            *bootstrap_interval(pairs, _ratio_of_sums, self._stream(name)),
        )

    def _stream(self, name: str) -> np.random.Generator:
        return stream(self.seed, f"bootstrap/{name}")


def proportion(successes: int, trials: int) -> Estimate:
    """Successes of trials, with Wilson bounds."""
    return Estimate(successes / trials, *wilson_interval(successes, trials))


def crossed_mean(values: np.ndarray) -> Estimate:
    """Mean of ``values`` (K, n) of K models in the same n contexts, both of which are draws."""
    return Estimate(float(values.mean()), *crossed_interval(values))


def crossed_rate(successes: np.ndarray) -> Estimate:
    """Rate of ``successes`` (K, n) of K models in the same n contexts, both of which are draws."""
    return Estimate(float(successes.mean()), *crossed_rate_interval(successes))


def without_interval(value: float) -> Estimate:
    """A count, or what a single training or clip gave; its bounds are NaN."""
    return Estimate(value, math.nan, math.nan)


def tidy(rows: Iterable[tuple[str, str, Estimate]]) -> pd.DataFrame:
    """A row for each (cell, metric, estimate), with the thesis's value beside it.

    Columns ``cell, metric, value, low, high, thesis, thesis_low, thesis_high``. The thesis's value is NaN
    where it states none, its bounds are NaN but for success rates (Wilson).
    """
    stated = [(*key, without_interval(value)) for key, value in thesis.VALUES.items()]
    stated += [
        (cell, "success_rate", proportion(count, thesis.RUNS)) for cell, count in thesis.SUCCESSES.items()
    ]
    published = _estimates(stated, "thesis", "thesis_low", "thesis_high")
    return _estimates(rows, "value", "low", "high").merge(published, on=["cell", "metric"], how="left")


def _estimates(rows: Iterable[tuple[str, str, Estimate]], *names: str) -> pd.DataFrame:
    records = [(cell, metric, found.value, found.low, found.high) for cell, metric, found in rows]
    return pd.DataFrame(records, columns=["cell", "metric", *names]).astype(dict.fromkeys(names, float))


def _sums(values: np.ndarray, groups: np.ndarray | None) -> np.ndarray:
    """(sum, count) of each group of ``values`` (n,), as (groups, 2); each value alone without ``groups``."""
    _, members = np.unique(np.arange(len(values)) if groups is None else groups, return_inverse=True)
    return np.stack([np.bincount(members, weights=values), np.bincount(members)], axis=1)


def _ratio_of_sums(draws: np.ndarray, axis: int) -> np.ndarray:
    """Of draws (RESAMPLES, n, 2): the first column's sum over the second's."""
    totals = draws.sum(axis=axis)
    return totals[..., 0] / totals[..., 1]
