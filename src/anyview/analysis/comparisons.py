"""Methods compared on shared contexts: paired differences, exact tests, the 2x2 of learning and data."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from anyview.analysis.cells import ABLATIONS, FACTORIAL, OURS, in_order
from anyview.analysis.estimates import Estimator
from anyview.analysis.statistics import holm, mcnemar_exact, sign_flip_test
from anyview.analysis.study import EvaluatedMethod

ENOUGH_RUNS = 6
"""Fewer paired runs carry no claim: not even a sign-flip test of runs that all agree would reach 5%."""
SIGNIFICANT = 0.05
TOLERANCE = 0.02
"""Metres: an object nearer than this is at the goal."""
FLOOR = 0.001
"""Metres: two objects nearer to the goal than this are equally near."""

Methods = Mapping[str, EvaluatedMethod]


def log_distance(metres: np.ndarray | pd.Series) -> np.ndarray:
    """The scale on which distances are compared: log(max(distance, FLOOR)), same shape.

    A run that misses by half a metre and one that misses by a centimetre then weigh by their ratio.
    """
    return np.log(np.maximum(np.asarray(metres, float), FLOOR))


def differences(methods: Methods, estimator: Estimator) -> pd.DataFrame:
    """Every method against `ours`, over the runs that both have; no rows where `ours` was not run.

    ``figure``: 19, or 20 for an ablation. ``value, low, high``: mean paired difference of final distance in
    metres (above 0: farther than ours). ``ratio, ratio_low, ratio_high``: geometric mean of how many times as
    far. ``p``: sign-flip test of the log distances. ``only_ours, only_other``: runs in which one alone
    succeeds; ``p_success`` of McNemar's test. Both tests are exact, and corrected for all contrasts of the
    figure. ``order``: see ``claimed``.
    """
    rows = []
    for cell in in_order(methods) if OURS in methods else ():
        if cell == OURS:
            continue
        pairs = methods[OURS].runs.merge(
            methods[cell].runs, on="run", suffixes=("", "_other"), validate="one_to_one"
        )
        ours, other = pairs["success"].to_numpy(bool), pairs["success_other"].to_numpy(bool)
        contrast = _contrast(
            f"{cell}/difference",
            (pairs["final_distance_other"] - pairs["final_distance"]).to_numpy(float),
            log_distance(pairs["final_distance_other"]) - log_distance(pairs["final_distance"]),
            estimator,
        )
        rows.append(
            {
                "cell": cell,
                "figure": 20 if cell in ABLATIONS else 19,
                **contrast,
                "only_ours": np.sum(ours & ~other),
                "only_other": np.sum(other & ~ours),
                "p_success": mcnemar_exact(ours, other),
            }
        )
    table = pd.DataFrame(rows, columns=["cell", "figure", *_CONTRAST, "only_ours", "only_other", "p_success"])
    for test in ("p", "p_success"):
        table[test] = table.groupby("figure")[test].transform(holm)
    return table.assign(order=claimed(table))


def effects(methods: Methods, estimator: Estimator) -> pd.DataFrame:
    """Contrasts of the 2x2 of final distance; no rows unless all four cells were run.

    Columns as in ``differences``, by ``name``: diverse contexts, our learning, and their interaction. A main
    effect averages over the other factor. All are means of per-run contrasts, so that what a context does to
    all four methods cancels. ``p`` is corrected for the three.
    """
    rows = []
    if _all_four(methods):
        series = {
            cell: methods[cell].runs.set_index("run")["final_distance"] for row in FACTORIAL for cell in row
        }
        metres = pd.DataFrame(series).dropna().to_numpy(float)  # runs, (narrow, diverse) x (Liu's, ours)
        for name, weights in (
            ("Diverse contexts instead of narrow ones", [-0.5, -0.5, 0.5, 0.5]),
            ("DDPG instead of Liu's TRPO", [-0.5, 0.5, -0.5, 0.5]),
            ("Both together, beyond what each does alone", [1, -1, -1, 1]),
        ):
            contrast = _contrast(
                f"factorial/{name}", metres @ weights, log_distance(metres) @ weights, estimator
            )
            rows.append({"name": name, **contrast})
    table = pd.DataFrame(rows, columns=["name", *_CONTRAST])
    table["p"] = holm(table["p"].to_numpy(float))
    return table.assign(order=claimed(table))


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


def claimed(
    contrasts: pd.DataFrame,
    counted: str = "runs",
    less: str = "nearer",
    more: str = "farther",
    enough: int = ENOUGH_RUNS,
) -> list[str]:
    """The order that may be claimed of each contrast: ``less`` or ``more``, ``open`` or ``few``.

    ``few``: the column ``counted`` is below ``enough``. ``open``: the corrected test does not exclude
    chance.
    """
    return [
        "few" if count < enough else "open" if p >= SIGNIFICANT else more if ratio > 1 else less
        for count, p, ratio in contrasts[[counted, "p", "ratio"]].itertuples(index=False)
    ]


_CONTRAST = ("runs", "value", "low", "high", "ratio", "ratio_low", "ratio_high", "p")


def _contrast(name: str, metres: np.ndarray, logs: np.ndarray, estimator: Estimator) -> dict[str, float]:
    """A contrast (n,) of runs, in metres and on the log scale, with the test that is not corrected yet."""
    mean, ratio = estimator.mean(name, metres), estimator.mean(f"{name}/log", logs).exponential()
    values = (len(metres), mean.value, mean.low, mean.high, ratio.value, ratio.low, ratio.high)
    return dict(zip(_CONTRAST, (*values, sign_flip_test(logs)), strict=True))


def _all_four(methods: Methods) -> bool:
    return all(cell in methods for row in FACTORIAL for cell in row)
