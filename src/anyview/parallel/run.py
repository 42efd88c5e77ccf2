"""The loop of `anyview repro`: start what can start, hear what has ended, show it."""

import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Protocol
from urllib.parse import quote

from anyview.parallel.durations import Duration, Durations
from anyview.parallel.graph import Graph, Node
from anyview.parallel.lockfile import names_in
from anyview.parallel.plan import simulate, ways
from anyview.parallel.progress import read_progress
from anyview.parallel.schedule import DONE, Schedule, State
from anyview.parallel.stage import Order, Result
from anyview.parallel.view import Moment, View
from anyview.runtime.device import worker_count

if TYPE_CHECKING:
    from dvc.stage import Stage

_TICK_SECONDS = 0.5


class Engine(Protocol):
    """Where stages run: ``processes.Processes`` or ``cluster.Cluster``.

    Together they use ``cores`` cores at most, one of them no more than ``largest``.
    """

    cores: int
    largest: int

    def fits(self, node: Node) -> bool: ...
    def start(self, node: Node, order: Order) -> None: ...
    def wait(self, seconds: float) -> list[Result]: ...
    def stop(self) -> None: ...


def log_of(folder: Path, address: str) -> Path:
    """The log of a stage, below the ``folder`` of this command's own files."""
    return folder / "logs" / f"{quote(address, safe='@')}.log"


def orders(graph: Graph, stages: "Mapping[str, Stage]", folder: Path, force: bool) -> dict[str, Order]:
    """What each stage's process is told. ``ANYVIEW_WORKERS`` tells the command its number of cores."""
    files = {address: _lock_file(stage) for address, stage in stages.items()}
    present = {path: names_in(path) for path in set(files.values()) if path}
    found: dict[str, Order] = {}
    later: dict[Path | None, tuple[str, ...]] = {}
    for address in reversed(graph):
        path = files[address]
        behind = later.get(path, ())
        workers = graph[address].needs.cores
        if os.environ.get("ANYVIEW_WORKERS"):
            workers = min(workers, worker_count())
        log = str(log_of(folder, address).absolute())
        found[address] = Order(address, force, {"ANYVIEW_WORKERS": str(workers)}, behind, log)
        if path and stages[address].name not in present[path]:
            later[path] = (stages[address].name, *behind)
    return found


def run(
    graph: Graph,
    orders: Mapping[str, Order],
    engine: Engine,
    durations: Durations,
    view: View,
    fail_fast: bool,
) -> tuple[Schedule, dict[str, Result]]:
    """Reproduce all of ``graph``; returns where each stage stands at the end and what became of it.

    However this ends, no stage is left running.
    """
    seconds = durations.on(graph, engine.largest)
    schedule = Schedule(graph, ways(graph, seconds), fail_fast)
    results: dict[str, Result] = {}
    since: dict[str, float] = {}
    try:
        while not schedule.over:
            for address in schedule.ready():
                if engine.fits(graph[address]):
                    Path(orders[address].log).unlink(missing_ok=True)
                    engine.start(graph[address], orders[address])
                    schedule.start(address)
            ended = engine.wait(_TICK_SECONDS)
            for address in schedule.of(State.RUNNING):
                # A cluster keeps a stage until a node has room; then it begins its log.
                if address not in since and Path(orders[address].log).exists():
                    since[address] = time.monotonic()
                    view.started(address)
            for result in ended:
                results[result.address] = result
                view.ended(result, schedule.finish(result.address, result.state))
                if result.state is State.RAN:
                    durations.keep(
                        result.address, Duration(result.seconds, graph[result.address].needs.cores)
                    )
            view.tick(lambda: _moment(schedule, orders, seconds, since, engine.cores))
    finally:
        view.close()
        engine.stop()
        durations.save()
    return schedule, results


def _moment(
    schedule: Schedule,
    orders: Mapping[str, Order],
    seconds: Mapping[str, float],
    since: Mapping[str, float],
    cores: int,
) -> Moment:
    now = time.monotonic()
    running = {}
    under_way = schedule.of(State.RUNNING)
    for address in (each for each in under_way if each in since):
        elapsed = now - since[address]
        running[address] = (elapsed, read_progress(Path(orders[address].log), elapsed, seconds.get(address)))
    left = {address: progress.left or 0.0 for address, (_, progress) in running.items()}
    over = [a for a, state in schedule.states.items() if state not in (State.RUNNING, State.WAITING)]
    waiting = [each for each in under_way if each not in since] + schedule.of(State.WAITING)
    unmeasured = [a for a in waiting if a not in seconds] + [
        a for a, (_, progress) in running.items() if progress.left is None
    ]
    plan = simulate(schedule.graph, seconds, cores, over, left)
    return Moment(
        running,
        {address: schedule.waits_for(address) for address in waiting},
        len(schedule.of(*DONE)),
        len(schedule.graph),
        plan.seconds,
        len(unmeasured),
    )


def _lock_file(stage: "Stage") -> Path | None:
    from dvc.stage import PipelineStage

    return Path(stage.dvcfile._lockfile.path) if isinstance(stage, PipelineStage) else None
