"""Methods compared on shared contexts: paired differences, McNemar, the 2x2 of learner and data."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from anyview.analysis.statistics import mcnemar_exact
from anyview.report.cells import FACTORIAL, OURS, in_order
from anyview.report.estimates import Estimate, Estimator
from anyview.report.inputs import Evaluation

ENOUGH_RUNS = 6
"""Fewer paired runs carry no claim: not even a sign test of runs that all agree would reach 5%."""


@dataclass(frozen=True)
class Comparison:
    """A method against `ours`: mean paired difference of final distance in metres (above 0: farther)."""

    cell: str
    runs: int
    difference: Estimate
    only_ours: int
    only_other: int
    p: float

    @property
    def ordered(self) -> bool:
        """Whether an order may be claimed: the paired interval excludes zero, and the runs suffice."""
        return self.runs >= ENOUGH_RUNS and self.difference.excludes_zero


@dataclass(frozen=True)
class Effect:
    """A contrast of the 2x2 in metres of final distance (below 0: nearer to the goal)."""

    name: str
    runs: int
    size: Estimate

    @property
    def present(self) -> bool:
        """Whether an effect may be claimed, by the same rule as an order."""
        return self.runs >= ENOUGH_RUNS and self.size.excludes_zero


def compare_with_ours(evaluations: Mapping[str, Evaluation], seed: int) -> list[Comparison]:
    """Every method against `ours`, over the runs that both have; empty where `ours` was not run."""
    if OURS not in evaluations:
        return []
    estimator = Estimator(seed)
    return [
        _comparison(estimator, cell, evaluations[OURS], evaluations[cell])
        for cell in in_order(evaluations)
        if cell != OURS
    ]


def factorial_effects(evaluations: Mapping[str, Evaluation], seed: int) -> list[Effect]:
    """Effects of diverse contexts, of DDPG, and their interaction; empty unless all four cells were run.

    A main effect averages over the other factor. All are means of per-run contrasts, so that what a context
    does to all four methods cancels.
    """
    if any(cell not in evaluations for row in FACTORIAL for cell in row):
        return []
    distances = _shared_distances({cell: evaluations[cell] for row in FACTORIAL for cell in row})
    (narrow_trpo, narrow_ddpg), (diverse_trpo, diverse_ddpg) = (
        [distances[cell] for cell in row] for row in FACTORIAL
    )
    contrasts = {
        "Diverse contexts instead of narrow ones": (diverse_trpo + diverse_ddpg - narrow_trpo - narrow_ddpg)
        / 2,
        "DDPG instead of TRPO": (narrow_ddpg + diverse_ddpg - narrow_trpo - diverse_trpo) / 2,
        "Both together, beyond the sum of each": (diverse_ddpg - diverse_trpo) - (narrow_ddpg - narrow_trpo),
    }
    estimator = Estimator(seed)
    return [
        Effect(name, len(values), estimator.mean(f"factorial/{name}", values.to_numpy()))
        for name, values in contrasts.items()
    ]


def _comparison(estimator: Estimator, cell: str, ours: Evaluation, other: Evaluation) -> Comparison:
    pairs = ours.runs.merge(other.runs, on="run", suffixes=("", "_other"), validate="one_to_one")
    difference = (pairs["final_distance_other"] - pairs["final_distance"]).to_numpy(float)
    first, second = pairs["success"].to_numpy(bool), pairs["success_other"].to_numpy(bool)
    return Comparison(
        cell,
        len(pairs),
        estimator.mean(f"{cell}/difference", difference),
        int(np.sum(first & ~second)),
        int(np.sum(second & ~first)),
        mcnemar_exact(first, second),
    )


def _shared_distances(evaluations: Mapping[str, Evaluation]) -> pd.DataFrame:
    """Final distances, a column per cell, over the runs that all have."""
    series = {cell: entry.runs.set_index("run")["final_distance"] for cell, entry in evaluations.items()}
    return pd.DataFrame(series).dropna()
