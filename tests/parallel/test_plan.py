"""Schedules against what must hold of every one, on random graphs."""

import hypothesis.strategies as st
from hypothesis import HealthCheck, given, settings

from anyview.parallel.graph import Graph, Node
from anyview.parallel.needs import Needs
from anyview.parallel.plan import simulate, ways
from anyview.parallel.schedule import DONE, Schedule, State

anywhere = settings(max_examples=40, suppress_health_check=[HealthCheck.too_slow])


@st.composite
def graphs(draw) -> tuple[Graph, dict[str, float]]:
    """Stages that depend on earlier ones, with cores and durations."""
    graph: Graph = {}
    for index in range(draw(st.integers(1, 12))):
        upstream = draw(st.sets(st.sampled_from(sorted(graph)))) if graph else set()
        graph[str(index)] = Node(str(index), frozenset(upstream), Needs(draw(st.integers(1, 4))))
    return graph, {name: float(draw(st.integers(1, 50))) for name in graph}


def longest(graph: Graph, seconds: dict[str, float]) -> float:
    """The length of the longest chain, by plain recursion."""

    def until(name: str) -> float:
        return seconds[name] + max((until(up) for up in graph[name].upstream), default=0.0)

    return max(until(name) for name in graph)


@anywhere
@given(graphs())
def test_with_cores_for_all_the_longest_chain_decides(case):
    graph, seconds = case
    plan = simulate(graph, seconds, cores=100)
    assert plan.seconds == longest(graph, seconds) == max(ways(graph, seconds).values())
    assert sum(takes for _, takes in plan.path) == plan.seconds


@anywhere
@given(graphs())
def test_one_core_takes_the_sum(case):
    graph, seconds = case
    assert simulate(graph, seconds, cores=1).seconds == sum(seconds.values())


@anywhere
@given(graphs(), st.integers(1, 6))
def test_no_schedule_uses_more_than_there_is_or_starts_too_early(case, cores):
    graph, seconds = case
    plan = simulate(graph, seconds, cores)
    ends = {name: start + seconds[name] for name, start in plan.starts.items()}
    assert set(ends) == set(graph)
    assert max(ends.values()) == plan.seconds
    for name, start in plan.starts.items():
        assert all(ends[up] <= start for up in graph[name].upstream)
        busy = [each for each, begin in plan.starts.items() if begin <= start < ends[each]]
        assert sum(min(graph[each].needs.cores, cores) for each in busy) <= cores
    # Graham's bound for list scheduling holds where each stage takes one core.
    if all(node.needs.cores == 1 for node in graph.values()):
        assert plan.seconds <= sum(seconds.values()) / cores + longest(graph, seconds)


@anywhere
@given(graphs())
def test_what_is_done_or_running_is_not_done_again(case):
    graph, seconds = case
    first = next(iter(graph))
    rest = {name: took for name, took in seconds.items() if name != first}
    assert first not in simulate(graph, seconds, 100, done=[first]).starts
    assert simulate(graph, seconds, 1, running={first: 0.5}).seconds == 0.5 + sum(rest.values())


@anywhere
@given(graphs(), st.booleans(), st.data())
def test_however_stages_end_the_run_comes_to_its_end(case, fail_fast, data):
    """A stage that is killed by itself, say by an administrator, leaves nothing waiting for it for ever."""
    graph, seconds = case
    schedule = Schedule(graph, ways(graph, seconds), fail_fast)
    ends = st.sampled_from([State.UNCHANGED, State.CACHED, State.RAN, State.FAILED, State.INTERRUPTED])
    while ready := schedule.ready():
        schedule.start(ready[0])
        schedule.finish(ready[0], data.draw(ends))
    assert schedule.over
    for address in schedule.of(*DONE):
        assert all(schedule.states[up] in DONE for up in graph[address].upstream)
