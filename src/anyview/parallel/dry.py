"""What a run would do with each stage, asked of DVC without changing anything."""

import logging
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from enum import StrEnum
from typing import TYPE_CHECKING

from anyview.parallel.graph import Graph

if TYPE_CHECKING:
    from dvc.repo import Repo
    from dvc.stage import Stage


class Forecast(StrEnum):
    """What would become of a stage. MAY_RUN: something before it may change."""

    UNCHANGED = "unchanged"
    CACHED = "cached"
    RUNS = "runs"
    MAY_RUN = "may run"


def forecast(repo: "Repo", graph: Graph, stages: "Mapping[str, Stage]", force: bool) -> dict[str, Forecast]:
    """The forecast of each stage, in DVC's order. DVC itself forecasts only stages whose inputs stand."""
    from dvc.repo import lock_repo

    found: dict[str, Forecast] = {}
    with lock_repo(repo), _silence():
        for address, node in graph.items():
            if force:
                found[address] = Forecast.RUNS
            elif any(found[upstream] is not Forecast.UNCHANGED for upstream in node.upstream):
                found[address] = Forecast.MAY_RUN
            else:
                found[address] = _forecast(repo, stages[address])
    return found


@contextmanager
def _silence() -> Iterator[None]:
    """DVC would announce each stage of the run cache."""
    before = logging.root.manager.disable
    logging.disable(logging.INFO)
    try:
        yield
    finally:
        logging.disable(before)


def _forecast(repo: "Repo", stage: "Stage") -> Forecast:
    from dvc.exceptions import DvcException
    from dvc.stage.cache import RunCacheNotFoundError

    if not stage.changed():
        return Forecast.UNCHANGED
    try:
        stage.save_deps()  # of the object alone: it is what the run cache is asked for
        repo.stage_cache.restore(stage, dry=True)
    except RunCacheNotFoundError:
        return Forecast.RUNS
    except DvcException:  # a dependency that is missing: the run will say so
        return Forecast.RUNS
    return Forecast.CACHED
