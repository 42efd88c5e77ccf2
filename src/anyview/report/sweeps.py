"""Experiments of `dvc exp` that vary one key of params.yaml, read back for one table and one picture."""

import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from anyview.report.review import Reading, flat, with_bounds
from anyview.runtime.errors import AnyviewError

PARAMS = "params.yaml"
METRICS = "metrics/"


@dataclass(frozen=True)
class Trial:
    """An experiment, or the commit: its name, and its params and metrics by dotted key."""

    name: str
    params: dict[str, Any]
    metrics: dict[str, Reading]


@dataclass(frozen=True)
class Sweep:
    """What ``key`` does to each of ``metrics``: trials in the order of its values.

    ``base`` is the commit that the experiments started from. ``left_out``: how many experiments do not count,
    because another key differs too, or a metric is missing (still queued, failed, not reported).
    """

    key: str
    metrics: tuple[str, ...]
    base: str
    trials: tuple[Trial, ...]
    left_out: int

    def values(self) -> list[Any]:
        """The values of ``key``, a trial each."""
        return [trial.params[self.key] for trial in self.trials]


def read_sweep(key: str, metrics: Sequence[str], root: Path = Path()) -> Sweep:
    """The experiments of the current commit that differ from it in ``key`` alone, and the commit itself.

    AnyviewError where ``key`` is not in params.yaml, or no finished experiment varies it.
    """
    states = _exp_show(root)
    commit = next((state for state in states if state["rev"] != "workspace"), None)
    if commit is None:
        raise AnyviewError("dvc exp show: no commit yet; commit, then run experiments")
    base = _trial(commit.get("name") or commit["rev"][:10], commit)
    if key not in base.params:
        raise AnyviewError(f"{key}: no such key in {PARAMS}; docs/params.md lists them")
    trials = [_trial(entry["name"], entry["revs"][0]) for entry in commit.get("experiments") or []]
    varied = [trial for trial in trials if trial.params != base.params]
    fit = [trial for trial in varied if _comparable(trial, base, key, metrics)]
    if not fit:
        raise AnyviewError(
            f"{key}: no finished experiment of this commit varies it alone and has {' and '.join(metrics)}; "
            f"run `dvc exp run --queue -S '{key}=...'`, then `dvc queue start`"
        )
    start = [base] if _comparable(base, base, key, metrics) else []
    ordered = sorted([*start, *fit], key=lambda trial: _rank(trial.params[key]))
    return Sweep(key, tuple(metrics), base.name, tuple(ordered), len(varied) - len(fit))


def table(sweep: Sweep) -> Iterator[str]:
    """The sweep as aligned text, a line per trial."""
    rows = [("experiment", sweep.key, *sweep.metrics)]
    for trial in sweep.trials:
        readings = (trial.metrics[metric] for metric in sweep.metrics)
        rows.append((trial.name, str(trial.params[sweep.key]), *map(str, readings)))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        yield "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()


def _exp_show(root: Path) -> list[dict[str, Any]]:
    command = [sys.executable, "-m", "dvc", "exp", "show", "--json"]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True)
    if done.returncode:
        lines = done.stderr.strip().splitlines() or ["failed"]
        raise AnyviewError(f"dvc exp show: {lines[-1].removeprefix('ERROR: ')}")
    return json.loads(done.stdout)


def _trial(name: str, state: dict[str, Any]) -> Trial:
    data = state.get("data") or {}
    metrics: dict[str, Reading] = {}
    for path, content in (data.get("metrics") or {}).items():
        group = path.removeprefix(METRICS).removesuffix(".json")
        metrics |= with_bounds(group, dict(flat(content.get("data") or {})))
    params = (data.get("params") or {}).get(PARAMS, {}).get("data") or {}
    return Trial(name, dict(flat(params)), metrics)


def _comparable(trial: Trial, base: Trial, key: str, metrics: Sequence[str]) -> bool:
    others_are_equal = trial.params | {key: None} == base.params | {key: None}
    return key in trial.params and others_are_equal and all(metric in trial.metrics for metric in metrics)


def _rank(value: Any) -> tuple[bool, float, str]:
    """Numbers by size, then everything else by its text."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return (not number, value if number else 0.0, str(value))
