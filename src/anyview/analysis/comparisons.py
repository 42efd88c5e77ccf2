"""Methods compared on shared contexts: paired differences, McNemar, the 2x2 of learner and data."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from anyview.analysis.cells import FACTORIAL, OURS, in_order
from anyview.analysis.estimates import Estimate, Estimator
from anyview.analysis.statistics import mcnemar_exact
from anyview.analysis.study import EvaluatedMethod

ENOUGH_RUNS = 6
"""Fewer paired runs carry no claim: not even a sign test of runs that all agree would reach 5%."""

Methods = Mapping[str, EvaluatedMethod]


def differences(methods: Methods, estimator: Estimator) -> pd.DataFrame:
    """Every method against `ours`, over the runs that both have; no rows where `ours` was not run.

    ``value, low, high``: mean paired difference of final distance in metres (above 0: farther than ours).
    ``only_ours, only_other``: runs in which one alone succeeds; ``p`` of McNemar's test. ``order``: see
    ``claimed``.
    """
    rows = []
    for cell in in_order(methods) if OURS in methods else ():
        if cell == OURS:
            continue
        pairs = methods[OURS].runs.merge(
            methods[cell].runs, on="run", suffixes=("", "_other"), validate="one_to_one"
        )
        distance = (pairs["final_distance_other"] - pairs["final_distance"]).to_numpy(float)
        found = estimator.mean(f"{cell}/difference", distance)
        ours, other = pairs["success"].to_numpy(bool), pairs["success_other"].to_numpy(bool)
        sides = (np.sum(ours & ~other), np.sum(other & ~ours), mcnemar_exact(ours, other))
        rows.append(
            (cell, len(pairs), found.value, found.low, found.high, *sides, claimed(found, len(pairs)))
        )
    names = ["cell", "runs", "value", "low", "high", "only_ours", "only_other", "p", "order"]
    return pd.DataFrame(rows, columns=names)


def effects(methods: Methods, estimator: Estimator) -> pd.DataFrame:
    """Contrasts of the 2x2 in metres of final distance; no rows unless all four cells were run.

    ``name, runs, value, low, high, order``: diverse contexts, DDPG, and their interaction. A main effect
    averages over the other factor. All are means of per-run contrasts, so that what a context does to all
    four methods cancels.
    """
    rows = []
    if _all_four(methods):
        series = {
            cell: methods[cell].runs.set_index("run")["final_distance"] for row in FACTORIAL for cell in row
        }
        distances = pd.DataFrame(series).dropna()
        (narrow_trpo, narrow_ddpg), (diverse_trpo, diverse_ddpg) = (
            [distances[cell] for cell in row] for row in FACTORIAL
        )
        contexts = (diverse_trpo + diverse_ddpg - narrow_trpo - narrow_ddpg) / 2
        learner = (narrow_ddpg + diverse_ddpg - narrow_trpo - diverse_trpo) / 2
        interaction = (diverse_ddpg - diverse_trpo) - (narrow_ddpg - narrow_trpo)
        for name, contrast in (
            ("Diverse contexts instead of narrow ones", contexts),
            ("DDPG instead of TRPO", learner),
            ("Both together, beyond the sum of each", interaction),
        ):
            found = estimator.mean(f"factorial/{name}", contrast.to_numpy())
            order = claimed(found, len(contrast))
            rows.append((name, len(contrast), found.value, found.low, found.high, order))
    return pd.DataFrame(rows, columns=["name", "runs", "value", "low", "high", "order"])


def factorial(methods: Methods, estimator: Estimator) -> pd.DataFrame:
    """Mean final distance in metres of each cell of the 2x2: ``contexts, learner, value, low, high``."""
    rows = []
    for contexts, row in zip(("narrow", "diverse"), FACTORIAL, strict=True):
        for learner, cell in zip(("TRPO", "DDPG"), row, strict=True):
            if _all_four(methods):
                distances = methods[cell].runs["final_distance"].to_numpy(float)
                found = estimator.mean(f"{cell}/mean_distance", distances)
                rows.append((contexts, learner, found.value, found.low, found.high))
    return pd.DataFrame(rows, columns=["contexts", "learner", "value", "low", "high"])


def claimed(difference: Estimate, runs: int) -> str:
    """The order that may be claimed of a paired difference: ``nearer``, ``farther``, ``open`` or ``few``.

    ``few``: fewer than ``ENOUGH_RUNS``. ``open``: the interval holds zero.
    """
    if runs < ENOUGH_RUNS:
        return "few"
    if not difference.excludes_zero:
        return "open"
    return "farther" if difference.value > 0 else "nearer"


def _all_four(methods: Methods) -> bool:
    return all(cell in methods for row in FACTORIAL for cell in row)
