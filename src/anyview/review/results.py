"""Params, metrics and lock of one revision, by dotted key."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from anyview.review.revisions import Revision
from anyview.runtime.errors import AnyviewError

PARAMS, METRICS, LOCK = "params.yaml", "metrics/", "dvc.lock"
SUMMARY = f"{METRICS}summary.json"  # repeats a few of the numbers, for `dvc metrics`


@dataclass(frozen=True)
class Measurement:
    """A metric's value and, if it is an estimate, its 95% bounds."""

    value: float
    low: float | None = None
    high: float | None = None

    def __str__(self) -> str:
        interval = "" if self.low is None else f" [{self.low:g}, {self.high:g}]"
        return f"{self.value:g}{interval}"

    def excludes(self, value: float) -> bool:
        """Whether ``value`` lies outside the bounds. Nothing does if there are none."""
        return self.low is not None and self.high is not None and not self.low <= value <= self.high


def read_params(revision: Revision) -> dict[str, Any]:
    """Every key of params.yaml; empty without the file."""
    return dict(flat(_yaml(revision, PARAMS)))


def read_metrics(revision: Revision) -> dict[str, Measurement]:
    """Metrics of ``metrics/<file>.json`` as ``<file>.<keys>``, with their bounds ``_low`` and ``_high``."""
    measurements: dict[str, Measurement] = {}
    for path in revision.files(METRICS):
        name, dot, suffix = path.removeprefix(METRICS).partition(".")
        if "/" in name or suffix != "json" or path == SUMMARY:
            continue
        try:
            numbers = {key: value + 0 for key, value in flat(json.loads(revision.read(path) or b""))}
        except (ValueError, TypeError, AttributeError) as error:
            raise AnyviewError(f"{path} ({revision.name}): not a tree of numbers: {error}") from None
        bounds = {f"{key}_{end}" for key in numbers for end in ("low", "high")}
        measurements |= {
            f"{name}{dot}{key}": Measurement(value, numbers.get(f"{key}_low"), numbers.get(f"{key}_high"))
            for key, value in numbers.items()
            if key not in bounds
        }
    return measurements


def read_lock(revision: Revision) -> dict[str, dict[str, Any]]:
    """The stages of dvc.lock as they were last run: {name: {cmd, deps, params, outs}}."""
    stages = _yaml(revision, LOCK).get("stages", {})
    if not isinstance(stages, dict) or not all(isinstance(entry, dict) for entry in stages.values()):
        raise AnyviewError(f"{LOCK} ({revision.name}): its stages are not readable")
    return stages


def flat(values: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """(dotted key, value) of every leaf of a tree."""
    for key, value in values.items():
        if isinstance(value, dict):
            yield from flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _yaml(revision: Revision, path: str) -> dict[str, Any]:
    content = revision.read(path)
    if content is None:
        return {}
    try:
        values = YAML(typ="safe", pure=True).load(content)
    except (YAMLError, ValueError) as error:  # ValueErrors: bytes that are no text, the 99th of May
        reason = " ".join(str(error).split())
        raise AnyviewError(f"{path} ({revision.name}): not valid YAML: {reason}") from None
    if not isinstance(values, dict):
        raise AnyviewError(f"{path} ({revision.name}): not a mapping of keys to values")
    return values
