"""The metrics that Git tracks: a summary for ``dvc metrics``, and details with 95% bounds beside it.

Written so that a review shows real changes alone: rounded, keys in a fixed order, no strings, no timings.
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from anyview.analysis.results import Results
from anyview.runtime.errors import AnyviewError
from anyview.runtime.outputs import write_atomically

Tree = dict[str, Any]


def metrics(results: Results) -> dict[str, Tree]:
    """Trees of numbers by the name of their file; AnyviewError if a number is not finite."""
    named = {"data": results.data, "translation": results.translation, "imitation": results.imitation}
    for name, table in named.items():
        for row in table[~np.isfinite(table["value"])].itertuples():
            raise AnyviewError(
                f"{name}.json: {row.cell}: {row.metric} is not a finite number; "
                "is a loss or a distance in data/ broken?"
            )
    return {"summary": summary(results), **{name: details(table) for name, table in named.items()}}


def write_metrics(folder: Path, trees: dict[str, Tree]) -> None:
    """Write each tree as JSON."""
    for name, tree in trees.items():
        write_atomically(folder / f"{name}.json", json.dumps(tree, indent=2) + "\n")


def details(table: pd.DataFrame) -> Tree:
    """A tidy table as a tree along the dots of ``cell`` and ``metric``, in four significant digits.

    An estimate ``m`` comes as ``m``, ``m_low`` and ``m_high``; what has no interval is a count.
    """
    tree: Tree = {}
    for row in table.itertuples():
        *groups, metric = f"{row.cell}.{row.metric}".split(".")
        branch = tree
        for group in groups:
            branch = branch.setdefault(group, {})
        if np.isnan(row.low):
            branch[metric] = int(row.value)
        else:
            for suffix, value in (("", row.value), ("_low", row.low), ("_high", row.high)):
                branch[metric + suffix] = _significant(value, 4)
    return tree


def summary(results: Results) -> Tree:
    """What a reviewer reads first, in so few digits that another run of the same study hardly changes them.

    ``success_percent`` and ``distance_cm`` (median, final) by method; ``held_out_loss`` by translator,
    over the validation clips; ``placed_percent`` and ``placed_percent_extreme``, frames with the
    object in its place, by translator of real clips; ``data`` counts demonstrations, and real clips by
    split.
    """
    methods, translators = results.imitation, results.translation
    real = translators[translators["cell"].isin(results.real)]
    return {
        "success_percent": _column(methods, "success_rate", lambda rate: round(100 * rate)),
        "distance_cm": _column(methods, "final_distance_median", lambda metres: round(100 * metres, 1)),
        "held_out_loss": _column(translators, "validation.loss", lambda loss: int(_significant(loss, 2))),
        "placed_percent": _column(real, "validation.placed", lambda share: round(100 * share)),
        "placed_percent_extreme": _column(real, "extreme.placed", lambda share: round(100 * share)),
        "data": _counts(results.data),
    }


def _column(table: pd.DataFrame, metric: str, rounded: Callable[[float], float]) -> Tree:
    rows = table[table["metric"] == metric]
    return {cell: rounded(value) for cell, value in zip(rows["cell"], rows["value"], strict=True)}


def _counts(data: pd.DataFrame) -> Tree:
    names = {"demos": "demonstrations"} | {
        name: name for name in ("train", "validation", "extreme", "refused")
    }
    rows = data[data["metric"].isin(names)]
    return {
        f"{row.cell.removeprefix('sim.')}_{names[row.metric]}": int(row.value) for row in rows.itertuples()
    }


def _significant(value: float, digits: int) -> float:
    return float(f"{value:.{digits}g}")
