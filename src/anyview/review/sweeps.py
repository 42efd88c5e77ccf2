"""Experiments of `dvc exp` that vary one key of params.yaml, read back for one table and one picture."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from anyview.review.results import PARAMS, Measurement, read_metrics, read_params
from anyview.review.revisions import Revision, find_revision
from anyview.runtime.errors import AnyviewError


@dataclass(frozen=True)
class Experiment:
    """A finished experiment, or the commit: its name, its value of the swept key and its metrics."""

    name: str
    value: Any
    metrics: dict[str, Measurement]


@dataclass(frozen=True)
class Sweep:
    """What ``key`` does to each of ``metrics``: experiments in the order of its values.

    ``base`` is the commit that they started from. ``left_out`` counts the finished experiments in which
    another key differs too, or a metric is missing.
    """

    key: str
    metrics: tuple[str, ...]
    base: str
    experiments: tuple[Experiment, ...]
    left_out: int


def read_sweep(key: str, metrics: Sequence[str], root: Path = Path()) -> Sweep:
    """The experiments of the current commit that differ from it in ``key`` alone, and the commit itself.

    Raises AnyviewError if ``key`` is not in params.yaml, or no finished experiment varies it.
    """
    commit = find_revision(root, "HEAD")
    base = read_params(commit)
    if key not in base:
        raise AnyviewError(f"{key}: no such key in {PARAMS}; docs/params.md lists them")
    start = _experiments({commit.name: commit}, base, key, metrics)
    varied = {name: state for name, state in commit.experiments().items() if read_params(state) != base}
    fit = _experiments(varied, base, key, metrics)
    if not fit:
        raise AnyviewError(
            f"{key}: no finished experiment of this commit varies it alone and has {' and '.join(metrics)}; "
            f"run `dvc exp run --queue -S '{key}=...'`, then `dvc queue start`"
        )
    ordered = sorted([*start, *fit], key=lambda experiment: _rank(experiment.value))
    return Sweep(key, tuple(metrics), commit.name, tuple(ordered), len(varied) - len(fit))


def table(sweep: Sweep) -> str:
    """The sweep as aligned text, a line for each experiment."""
    rows = [(each.name, each.value, *each.metrics.values()) for each in sweep.experiments]
    columns = ["experiment", sweep.key, *sweep.metrics]
    return pd.DataFrame(rows, columns=columns, dtype=object).to_string(index=False)


def is_number(value: Any) -> bool:
    """Whether ``value`` has a place on an axis."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def _experiments(
    states: dict[str, Revision], base: dict[str, Any], key: str, metrics: Sequence[str]
) -> list[Experiment]:
    """Those of ``states`` that have ``key`` and ``metrics``, and the params ``base`` but for ``key``."""
    experiments = []
    for name, state in states.items():
        params, measured = read_params(state), read_metrics(state)
        others_are_equal = params | {key: None} == base | {key: None}
        if key in params and others_are_equal and measured.keys() >= set(metrics):
            experiments.append(
                Experiment(name, params[key], {metric: measured[metric] for metric in metrics})
            )
    return experiments


def _rank(value: Any) -> tuple[bool, float, str]:
    """Numbers by size, then everything else by its text."""
    return (not is_number(value), value if is_number(value) else 0.0, str(value))
