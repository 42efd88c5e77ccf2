"""What changed between two states of the project: params, metrics against their intervals, strips, stages."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from anyview.report.revisions import Revision
from anyview.runtime.errors import AnyviewError

METRICS = ("metrics/data.json", "metrics/translation.json", "metrics/imitation.json")
STRIPS = "metrics/plots"


@dataclass(frozen=True)
class ParamChange:
    """A key of params.yaml; None where a state does not have it."""

    key: str
    before: Any
    after: Any


@dataclass(frozen=True)
class Reading:
    """A metric's value and, where it is an estimate, its 95% bounds."""

    value: float
    low: float | None = None
    high: float | None = None

    def __str__(self) -> str:
        interval = "" if self.low is None else f" [{self.low:g}, {self.high:g}]"
        return f"{self.value:g}{interval}"


@dataclass(frozen=True)
class MetricChange:
    """A metric that is not the same in both states."""

    key: str
    before: Reading | None
    after: Reading | None

    @property
    def beyond(self) -> bool:
        """Whether each value lies outside the other's 95% interval: more than the luck of the draw."""
        if self.before is None or self.after is None:
            return False
        return _outside(self.before, self.after) and _outside(self.after, self.before)


@dataclass(frozen=True)
class StageChange:
    """A stage (``imitate@ours``) whose entry in dvc.lock changed, and why; did its outputs?"""

    name: str
    causes: tuple[str, ...]
    outputs_changed: bool


@dataclass(frozen=True)
class Review:
    """Everything that differs from ``before`` to ``after``."""

    before: str
    after: str
    params: tuple[ParamChange, ...]
    metrics: tuple[MetricChange, ...]
    strips: tuple[str, ...]
    stages: tuple[StageChange, ...]
    unchanged_stages: int


def compare(before: Revision, after: Revision) -> Review:
    """Compare two states. A file that one lacks counts as empty; a broken one raises AnyviewError."""
    old_lock, new_lock = _lock(before), _lock(after)
    stages = tuple(_stage_changes(old_lock, new_lock))
    return Review(
        before.name,
        after.name,
        tuple(_param_changes(_yaml(before, "params.yaml"), _yaml(after, "params.yaml"))),
        tuple(_metric_changes(_readings(before), _readings(after))),
        tuple(_changed_pictures(before, after)),
        stages,
        len(new_lock) - sum(change.name in new_lock for change in stages),
    )


def _outside(reading: Reading, other: Reading) -> bool:
    return other.low is not None and other.high is not None and not other.low <= reading.value <= other.high


def _yaml(revision: Revision, path: str) -> dict[str, Any]:
    content = revision.read(path)
    if content is None:
        return {}
    try:
        values = YAML(typ="safe", pure=True).load(content)
    except (YAMLError, UnicodeDecodeError) as error:
        raise AnyviewError(
            f"{path} ({revision.name}): not valid YAML: {' '.join(str(error).split())}"
        ) from None
    if not isinstance(values, dict):
        raise AnyviewError(f"{path} ({revision.name}): not a mapping of keys to values")
    return values


def flat(values: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """(dotted key, value) of every leaf of a tree."""
    for key, value in values.items():
        if isinstance(value, dict):
            yield from flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def with_bounds(group: str, numbers: dict[str, float]) -> dict[str, Reading]:
    """Metrics as ``group.key``: ``m``, ``m_low`` and ``m_high`` make one reading."""
    readings = {}
    for key, value in numbers.items():
        if key.removesuffix("_low").removesuffix("_high") in numbers and key.endswith(("_low", "_high")):
            continue
        readings[f"{group}.{key}"] = Reading(value, numbers.get(f"{key}_low"), numbers.get(f"{key}_high"))
    return readings


def _param_changes(before: dict[str, Any], after: dict[str, Any]) -> Iterator[ParamChange]:
    old, new = dict(flat(before)), dict(flat(after))
    for key in dict.fromkeys([*old, *new]):
        if old.get(key) != new.get(key):
            yield ParamChange(key, old.get(key), new.get(key))


def _readings(revision: Revision) -> dict[str, Reading]:
    readings: dict[str, Reading] = {}
    for path in METRICS:
        content = revision.read(path)
        if content is None:
            continue
        try:
            numbers = {key: value + 0 for key, value in flat(json.loads(content))}
        except (ValueError, TypeError, AttributeError) as error:
            raise AnyviewError(f"{path} ({revision.name}): not a tree of numbers: {error}") from None
        readings |= with_bounds(path.removeprefix("metrics/").removesuffix(".json"), numbers)
    return readings


def _metric_changes(old: dict[str, Reading], new: dict[str, Reading]) -> Iterator[MetricChange]:
    for key in dict.fromkeys([*old, *new]):
        if old.get(key) != new.get(key):
            yield MetricChange(key, old.get(key), new.get(key))


def _changed_pictures(before: Revision, after: Revision) -> Iterator[str]:
    for path in sorted({*before.files(STRIPS), *after.files(STRIPS)}):
        if path.endswith(".png") and before.read(path) != after.read(path):
            yield path


def _lock(revision: Revision) -> dict[str, dict[str, Any]]:
    stages = _yaml(revision, "dvc.lock").get("stages", {})
    if not isinstance(stages, dict) or not all(isinstance(entry, dict) for entry in stages.values()):
        raise AnyviewError(f"dvc.lock ({revision.name}): its stages are not readable")
    return stages


def _stage_changes(old: dict[str, dict[str, Any]], new: dict[str, dict[str, Any]]) -> Iterator[StageChange]:
    for name in dict.fromkeys([*old, *new]):
        if name not in new:
            yield StageChange(name, ("removed",), True)
        elif name not in old:
            yield StageChange(name, ("new",), True)
        elif old[name] != new[name]:
            causes = tuple(_causes(old[name], new[name]))
            outputs_changed = _hashes(old[name], "outs") != _hashes(new[name], "outs")
            yield StageChange(name, causes or ("run again",), outputs_changed)


def _causes(old: dict[str, Any], new: dict[str, Any]) -> Iterator[str]:
    if old.get("cmd") != new.get("cmd"):
        yield "command"
    changes = _param_changes(
        old.get("params", {}).get("params.yaml", {}), new.get("params", {}).get("params.yaml", {})
    )
    yield from (change.key for change in changes)
    before, after = _hashes(old, "deps"), _hashes(new, "deps")
    yield from (path for path in dict.fromkeys([*before, *after]) if before.get(path) != after.get(path))


def _hashes(entry: dict[str, Any], kind: str) -> dict[str, str]:
    return {item["path"]: item.get("md5", "") for item in entry.get(kind, [])}
