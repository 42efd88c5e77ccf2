"""What differs between two states: params, metrics against their intervals, pictures, stages rerun."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from hashlib import md5
from typing import Any

from anyview.review.results import PARAMS, flat, read_lock, read_metrics, read_params
from anyview.review.revisions import Revision

PICTURES = "metrics/plots"


@dataclass(frozen=True)
class Change:
    """What has this key or path, before and after; None in a state that does not have it."""

    key: str
    before: Any
    after: Any

    @property
    def beyond_intervals(self) -> bool:
        """Of a metric: whether each value lies outside the other's 95% interval, more than luck explains."""
        if self.before is None or self.after is None:
            return False
        return self.before.excludes(self.after.value) and self.after.excludes(self.before.value)


@dataclass(frozen=True)
class StageChange:
    """A stage (``imitate@ours``) whose entry in dvc.lock changed, and why; did its outputs?"""

    name: str
    causes: tuple[str, ...]
    outputs_changed: bool


@dataclass(frozen=True)
class Review:
    """Everything that differs from ``before`` to ``after``.

    ``params`` are changes of values, ``metrics`` of Measurements, ``pictures`` of the MD5 of PNG files.
    """

    before: Revision
    after: Revision
    params: tuple[Change, ...]
    metrics: tuple[Change, ...]
    pictures: tuple[Change, ...]
    stages: tuple[StageChange, ...]
    unchanged_stages: int


def compare(before: Revision, after: Revision) -> Review:
    """Compare two states. A missing file counts as empty. Raises AnyviewError if one is broken."""
    old, new = read_lock(before), read_lock(after)
    return Review(
        before,
        after,
        tuple(_changes(read_params(before), read_params(after))),
        tuple(_changes(read_metrics(before), read_metrics(after))),
        tuple(_changes(_pictures(before), _pictures(after))),
        tuple(_stage_change(change) for change in _changes(old, new)),
        sum(old.get(name) == entry for name, entry in new.items()),
    )


def _changes(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[Change]:
    for key in dict.fromkeys([*old, *new]):
        if old.get(key) != new.get(key):
            yield Change(key, old.get(key), new.get(key))


def _pictures(revision: Revision) -> dict[str, str]:
    paths = (path for path in revision.files(PICTURES) if path.endswith(".png"))
    return {path: md5(revision.read(path) or b"").hexdigest() for path in paths}


def _stage_change(entry: Change) -> StageChange:
    if entry.before is None or entry.after is None:
        return StageChange(entry.key, ("new" if entry.before is None else "removed",), True)
    causes = ["command"] if entry.before.get("cmd") != entry.after.get("cmd") else []
    causes += [change.key for change in _changes(_params(entry.before), _params(entry.after))]
    causes += [change.key for change in _changes(_hashes(entry.before, "deps"), _hashes(entry.after, "deps"))]
    outputs_changed = _hashes(entry.before, "outs") != _hashes(entry.after, "outs")
    return StageChange(entry.key, tuple(causes or ["run again"]), outputs_changed)


def _params(entry: dict[str, Any]) -> dict[str, Any]:
    return dict(flat(entry.get("params", {}).get(PARAMS, {})))


def _hashes(entry: dict[str, Any], kind: str) -> dict[str, str]:
    return {item["path"]: item.get("md5", "") for item in entry.get(kind, [])}
