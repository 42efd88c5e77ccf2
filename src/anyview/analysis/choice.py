"""Does the clip decide? Methods that are shown one of two goals, in contexts that are run once for each."""

from collections.abc import Iterator

import pandas as pd

from anyview.analysis.cells import in_order
from anyview.analysis.comparisons import TOLERANCE, Methods
from anyview.analysis.estimates import Estimate, Estimator, proportion, tidy, without_interval
from anyview.analysis.statistics import mcnemar_exact
from anyview.analysis.study import EvaluatedMethod

CHOICE = "choice"


def choosing(methods: Methods) -> dict[str, EvaluatedMethod]:
    """The methods that are shown one of two goals, in the order of ``cells.in_order``."""
    return {cell: methods[cell] for cell in in_order(methods) if "choice" in methods[cell].runs}


def choices(methods: Methods, estimator: Estimator) -> pd.DataFrame:
    """A table as ``estimates.tidy`` makes it.

    ``shown_rate`` and ``other_rate``: runs that end within 2 cm of the goal that was shown, and of the other,
    with Wilson bounds. ``shown_distance`` and ``other_distance``: medians in metres.
    """
    return tidy(_choices(methods, estimator))


def _choices(methods: Methods, estimator: Estimator) -> Iterator[tuple[str, str, Estimate]]:
    for cell, method in choosing(methods).items():
        runs = method.runs
        yield cell, "runs", without_interval(len(runs))
        for name, column in (("shown", "final_distance"), ("other", "other_distance")):
            at_goal = runs[column] < TOLERANCE
            yield cell, f"{name}_rate", proportion(int(at_goal.sum()), len(runs))
        for name, column in (("shown", "final_distance"), ("other", "other_distance")):
            distances = runs[column].to_numpy(float)
            yield cell, f"{name}_distance", estimator.median(f"{cell}/{column}", distances)


def against_choice(methods: Methods, estimator: Estimator) -> pd.DataFrame:
    """Every method against `choice`, run by run: the same context, the same goal shown.

    ``cell, runs, value, low, high``: mean paired difference of the distance to the shown goal in metres
    (above 0: farther than `choice`), both runs of a context drawn together. ``only_choice, only_other``: runs
    in which one alone ends at the shown goal; ``p`` of McNemar's test. No rows where `choice` was not run.
    """
    rows = []
    compared = choosing(methods)
    for cell, method in compared.items() if CHOICE in compared else ():
        if cell == CHOICE:
            continue
        keys = ["context", "choice"]
        pairs = compared[CHOICE].runs.merge(
            method.runs, on=keys, suffixes=("", "_other"), validate="one_to_one"
        )
        farther = (pairs["final_distance_other"] - pairs["final_distance"]).to_numpy(float)
        found = estimator.mean(f"{cell}/against choice", farther, pairs["context"].to_numpy())
        ours, other = pairs["success"].to_numpy(bool), pairs["success_other"].to_numpy(bool)
        sides = int((ours & ~other).sum()), int((other & ~ours).sum()), mcnemar_exact(ours, other)
        rows.append((cell, len(pairs), found.value, found.low, found.high, *sides))
    names = ["cell", "runs", "value", "low", "high", "only_choice", "only_other", "p"]
    return pd.DataFrame(rows, columns=names)
