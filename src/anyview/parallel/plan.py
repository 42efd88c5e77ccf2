"""What the graph and measured durations say: the critical path, and the time that a number of cores takes."""

import heapq
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from anyview.parallel.graph import Graph
from anyview.parallel.needs import Machine, Needs
from anyview.parallel.schedule import Schedule, State


@dataclass(frozen=True)
class Plan:
    """The expected run on ``cores`` cores: ``seconds`` in all, and the ``path`` that decides it.

    ``path`` are stages with their seconds, each of which started when the one before it ended. ``starts`` are
    all stages with the seconds at which they start, the first one first.
    """

    cores: int
    seconds: float
    path: list[tuple[str, float]]
    starts: dict[str, float]


def ways(graph: Graph, seconds: Mapping[str, float]) -> dict[str, float]:
    """Seconds from each stage's start to the end of the longest way through what depends on it.

    Where nothing is measured, stages count one second each: then the most stages in a row go first.
    """
    unknown = 1.0 if not any(seconds.values()) else 0.0
    way = {address: seconds.get(address, 0.0) or unknown for address in graph}
    for address in reversed(graph):  # in DVC's order, what is upstream comes first
        for upstream in graph[address].upstream & graph.keys():
            own = seconds.get(upstream, 0.0) or unknown
            way[upstream] = max(way[upstream], own + way[address])
    return way


def simulate(
    graph: Graph,
    seconds: Mapping[str, float],
    cores: int,
    done: Collection[str] = (),
    running: Mapping[str, float] | None = None,
) -> Plan:
    """The schedule that ``anyview repro`` would follow on ``cores`` cores.

    ``seconds`` are durations there. ``done`` stages take no time. ``running`` ones have so many seconds left.
    GPUs and memory are taken to suffice.
    """
    machine = Machine(cores)
    needs = {address: Needs(node.needs.cores) for address, node in graph.items()}
    schedule = Schedule(graph, ways(graph, seconds))
    for address in done:
        schedule.finish(address, State.UNCHANGED)
    ahead: list[tuple[float, str]] = []
    started: dict[str, float] = {}
    before: dict[str, str | None] = {}
    now, last = 0.0, None

    def start(address: str, takes: float) -> None:
        schedule.start(address)
        machine.take(needs[address])
        started[address], before[address] = now, last
        heapq.heappush(ahead, (now + takes, address))

    for address, left in (running or {}).items():
        start(address, left)
    while True:
        for address in schedule.ready():
            if machine.fits(needs[address]):
                start(address, seconds.get(address, 0.0))
        if not ahead:
            break
        now, last = heapq.heappop(ahead)
        machine.give(needs[last], ())
        schedule.finish(last, State.RAN)
    return Plan(cores, now, _path(last, now, started, before), started)


def _path(
    last: str | None, end: float, started: Mapping[str, float], before: Mapping[str, str | None]
) -> list[tuple[str, float]]:
    path: list[tuple[str, float]] = []
    while last is not None:
        path.append((last, end - started[last]))
        end, last = started[last], before[last]
    return path[::-1]
