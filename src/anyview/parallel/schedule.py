"""Which stage may start next: a state machine that knows neither time nor processes."""

from collections.abc import Mapping
from enum import StrEnum

from anyview.parallel.graph import Graph


class State(StrEnum):
    """Where a stage stands; from UNCHANGED on, it is over."""

    WAITING = "waiting"
    RUNNING = "running"
    UNCHANGED = "unchanged"
    CACHED = "cached"  # its outputs came from the run cache
    RAN = "ran"
    FAILED = "failed"
    SKIPPED = "skipped"  # behind one that failed, or not begun when another failed
    INTERRUPTED = "interrupted"


DONE = (State.UNCHANGED, State.CACHED, State.RAN)
_BLOCKING = (State.FAILED, State.SKIPPED, State.INTERRUPTED)  # what depends on such a stage cannot run


class Schedule:
    """The states of a graph's stages.

    The longest way to the end goes first: ``ways`` are its seconds from each stage's start (``plan.ways``).
    With ``fail_fast`` nothing starts after a failure; without, only what depends on what failed is skipped.
    """

    def __init__(self, graph: Graph, ways: Mapping[str, float], fail_fast: bool = False):
        self.graph = graph
        self.states = dict.fromkeys(graph, State.WAITING)
        self._fail_fast = fail_fast
        self._order = sorted(graph, key=lambda address: -ways[address])  # stable: else in DVC's order

    def ready(self) -> list[str]:
        """Stages that wait for no other, the most urgent first."""
        return [address for address in self._order if self._waits(address) and not self.waits_for(address)]

    def waits_for(self, address: str) -> list[str]:
        """Stages that ``address`` depends on and that are not done."""
        return sorted(each for each in self.graph[address].upstream if self.states[each] not in DONE)

    def start(self, address: str) -> None:
        """``address`` runs now."""
        self.states[address] = State.RUNNING

    def finish(self, address: str, state: State) -> list[str]:
        """``address`` ended in ``state``; returns the stages that are skipped for that."""
        self.states[address] = state
        if state in DONE:
            return []
        skipped = []
        for each in self.graph:  # in DVC's order, so that what is upstream comes first
            behind = any(self.states[up] in _BLOCKING for up in self.graph[each].upstream)
            if self._waits(each) and (self._fail_fast or behind):
                self.states[each] = State.SKIPPED
                skipped.append(each)
        return skipped

    def of(self, *states: State) -> list[str]:
        """Stages in any of ``states``, in DVC's order."""
        return [address for address, state in self.states.items() if state in states]

    @property
    def over(self) -> bool:
        """Whether nothing runs or waits."""
        return not self.of(State.WAITING, State.RUNNING)

    def _waits(self, address: str) -> bool:
        return self.states[address] is State.WAITING
