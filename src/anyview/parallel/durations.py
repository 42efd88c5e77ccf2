"""How long stages took, kept in DVC's temporary folder, so that plans and times left rest on measurements.

Never in an output or in dvc.lock: a cache has to hit on another machine.
"""

import csv
import json
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from anyview.parallel.graph import Graph
from anyview.runtime.errors import AnyviewError
from anyview.runtime.outputs import write_atomically
from anyview.runtime.scratch import content_key

if TYPE_CHECKING:
    from dvc.stage import Stage


@dataclass(frozen=True)
class Duration:
    """``seconds`` that a stage's command took with ``cores``."""

    seconds: float
    cores: int

    def on(self, cores: int) -> float:
        """Seconds with ``cores``, if its work divides evenly: a stage states only cores that it can use."""
        return self.seconds * self.cores / cores


class Durations:
    """The newest measurement of each stage at each scale, in ``path``.

    A scale is the stage's command and the values of its params: the profile `smoke` says nothing of `study`.
    """

    def __init__(self, path: Path, stages: "Mapping[str, Stage]"):
        self._path = path
        files: dict[str, Any] = {}
        self._keys = {address: f"{address} {_scale(stage, files)}" for address, stage in stages.items()}
        self._kept = _read(path)

    def of(self, address: str) -> Duration | None:
        """The newest measurement of ``address`` at its present scale."""
        return self._kept.get(self._keys[address])

    def on(self, graph: Graph, cores: int) -> dict[str, float]:
        """Seconds of each measured stage of ``graph``, when stages have ``cores`` together."""
        found = {address: self.of(address) for address in graph}
        return {
            address: duration.on(graph[address].needs.on(cores).cores)
            for address, duration in found.items()
            if duration
        }

    def keep(self, address: str, duration: Duration) -> None:
        """Remember a new measurement, once saved."""
        self._kept[self._keys[address]] = duration

    def save(self) -> None:
        """Write what is remembered."""
        write_atomically(self._path, json.dumps({key: asdict(each) for key, each in self._kept.items()}))


def read_table(path: Path, addresses: Collection[str]) -> dict[str, Duration]:
    """Measurements from a table with the columns ``stage``, ``seconds`` and ``cores``.

    Raises AnyviewError if one of its stages is not of ``addresses`` or one of its numbers is none.
    """
    table = {}
    for number, row in enumerate(_rows(path), 2):
        try:
            stage, seconds, cores = row["stage"], float(row["seconds"]), int(row["cores"])
        except (KeyError, TypeError, ValueError):
            raise AnyviewError(
                f"{path}, line {number}: needs the columns stage, seconds, cores; two are numbers"
            ) from None
        if stage not in addresses or not seconds >= 0 or cores < 1:
            raise AnyviewError(
                f"{path}, line {number}: {stage} is no stage here, or its numbers are not positive"
            )
        table[stage] = Duration(seconds, cores)
    return table


def _rows(path: Path) -> list[dict[str, str]]:
    try:
        with path.open(newline="", encoding="utf-8") as file:
            return list(csv.DictReader(file))
    except (csv.Error, UnicodeError) as error:
        raise AnyviewError(f"{path}: not a table: {error}") from None


def _read(path: Path) -> dict[str, Duration]:
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        return {key: Duration(float(each["seconds"]), int(each["cores"])) for key, each in kept.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}  # measurements can be lost, and are made again


def _scale(stage: "Stage", files: dict[str, Any]) -> str:
    """A key of the command of ``stage`` and of its params' values; ``files`` are parsed ones, by path."""
    from dvc.dependency import ParamsDependency
    from dvc.utils.serialize import LOADERS, ParseError

    values: list[Any] = [stage.cmd]
    for dep in stage.deps:
        if isinstance(dep, ParamsDependency):
            path = Path(dep.fs_path)
            if dep.fs_path not in files:
                try:
                    files[dep.fs_path] = LOADERS[path.suffix.lower()](dep.fs_path)
                except (OSError, ParseError):  # DVC will say so when the stage runs
                    files[dep.fs_path] = {}
            values += [_look_up(files[dep.fs_path], key) for key in dep.params] or [files[dep.fs_path]]
    return content_key(json.loads(json.dumps(values, default=str)))[:12]


def _look_up(tree: Any, key: str) -> Any:
    for part in key.split("."):
        tree = tree.get(part) if isinstance(tree, Mapping) else None
    return tree
