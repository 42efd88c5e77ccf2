"""The command `anyview repro`."""

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from anyview.runtime.errors import AnyviewError

if TYPE_CHECKING:
    from dvc.repo import Repo
    from dvc.stage import Stage

    from anyview.parallel.durations import Durations
    from anyview.parallel.graph import Graph

_FAILED = 1  # exit code
_FOLDER = "parallel"  # of logs and durations, in DVC's temporary folder


def repro(
    targets: Annotated[
        list[str] | None, typer.Argument(help="Stages, as for dvc repro; default all.")
    ] = None,
    jobs: Annotated[
        str,
        typer.Option("--jobs", "-j", help="Cores that stages use together; default all.", show_default=False),
    ] = "",
    force: Annotated[
        bool, typer.Option("--force", "-f", help="Run stages that did not change, too.")
    ] = False,
    keep_going: Annotated[
        bool,
        typer.Option(
            "--keep-going/--fail-fast",
            help="After a failure, skip what depends on it; or start nothing more, as dvc repro does.",
        ),
    ] = True,
    dry: Annotated[bool, typer.Option("--dry", help="Run nothing; print the schedule.")] = False,
    plan: Annotated[
        bool,
        typer.Option("--plan", help="Run nothing; print the time that all stages take: --plan --jobs 1 2 8."),
    ] = False,
    durations: Annotated[
        Path | None,
        typer.Option(
            "--durations", help="For --plan: a table of stage, seconds and cores, instead of measured."
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for a script.")] = False,
) -> None:
    """Run the stages of a DVC repository side by side, each as soon as what it depends on is done.

    Works in any DVC repository. Each stage is reproduced by DVC, and results are those of `dvc repro`.
    A stage may state `meta: {cores: 2, gpus: 1, memory: 4 GB}` in dvc.yaml. With ANYVIEW_BACKEND=ray,
    stages are tasks of the Ray cluster at RAY_ADDRESS.
    """
    import joblib

    from anyview.parallel.durations import Durations
    from anyview.parallel.graph import collect, open_repository

    names, counts = _split_jobs(targets or [], jobs, plan)
    here = counts or [joblib.cpu_count()]
    with open_repository() as repo:
        graph, stages = collect(repo, names)
        folder = Path(os.path.relpath(repo.tmp_dir)) / _FOLDER
        known = Durations(folder / "durations.json", stages)
        if plan:
            _print_plan(graph, known, durations, here, as_json)
        elif dry:
            _print_schedule(repo, graph, stages, known, here[0], force, as_json)
        else:
            count = counts[0] if counts else None
            _run(repo, graph, stages, known, folder, count, force, not keep_going, as_json)


def _split_jobs(targets: list[str], jobs: str, plan: bool) -> tuple[list[str], list[int]]:
    """Targets and numbers of cores: `--plan --jobs 1 2 8` reaches us as the job 1 and the targets 2 and 8."""
    if not jobs:
        return targets, []
    names = [target for target in targets if not (plan and target.isdecimal())]
    counts = jobs.split(",") + [target for target in targets if target not in names]
    if not all(count.isascii() and count.isdecimal() and int(count) for count in counts):
        raise AnyviewError(f"--jobs {jobs}: must be a whole number of at least 1")
    if len(counts) > 1 and not plan:
        raise AnyviewError(f"--jobs {jobs}: only --plan takes several numbers")
    return names, [int(count) for count in counts]


def _run(
    repo: "Repo",
    graph: "Graph",
    stages: "dict[str, Stage]",
    known: "Durations",
    folder: Path,
    jobs: int | None,
    force: bool,
    fail_fast: bool,
    as_json: bool,
) -> None:
    import joblib

    from anyview.parallel.graph import on_cores
    from anyview.parallel.needs import this_machine
    from anyview.parallel.repair import drop_broken_rwlock
    from anyview.parallel.run import Engine, log_of, orders, run
    from anyview.parallel.schedule import DONE, State
    from anyview.parallel.view import make_view, some
    from anyview.runtime.errors import raise_when_terminated

    raise_when_terminated()
    drop_broken_rwlock(repo)
    engine: Engine
    if os.environ.get("ANYVIEW_BACKEND", "local") == "ray":
        from anyview.parallel.cluster import Cluster

        engine = Cluster(jobs)
    else:
        from anyview.parallel.processes import Processes

        machine = this_machine(jobs or joblib.cpu_count())
        for address, node in graph.items():
            machine.check(node.needs, address)
        engine = Processes(machine, stages)
    graph = on_cores(graph, engine.largest)
    schedule, results = run(
        graph, orders(graph, stages, folder, force), engine, known, make_view(as_json), fail_fast
    )
    failed = schedule.of(State.FAILED, State.INTERRUPTED)
    if as_json:
        states = {state: schedule.of(state) for state in State if schedule.of(state)}
        print(json.dumps({"event": "end", "stages": states}))
    elif schedule.of(State.UNCHANGED) == list(graph):
        print("Data and pipelines are up to date.")
    else:
        counts = {state: len(schedule.of(state)) for state in (*DONE, State.FAILED, State.INTERRUPTED)}
        print(", ".join(f"{count} {state}" for state, count in counts.items() if count))
        if skipped := schedule.of(State.SKIPPED):
            print(f"skipped: {some(skipped)}")
        for address in failed:
            state, message = schedule.states[address], results[address].message
            print(f"{address} {state}: {message}; its log: cat '{log_of(folder, address)}'")
    if failed:
        raise typer.Exit(_FAILED)


def _print_schedule(
    repo: "Repo",
    graph: "Graph",
    stages: "dict[str, Stage]",
    known: "Durations",
    cores: int,
    force: bool,
    as_json: bool,
) -> None:
    """Stages in the order in which they would start."""
    from anyview.parallel.dry import Forecast, forecast
    from anyview.parallel.plan import simulate
    from anyview.parallel.view import clock, some

    found = forecast(repo, graph, stages, force)
    seconds = known.on(graph, cores)
    done = [address for address, state in found.items() if state in (Forecast.UNCHANGED, Forecast.CACHED)]
    expected = simulate(graph, seconds, cores, done)
    order = [*done, *expected.starts]
    if as_json:
        rows = [
            {
                "stage": address,
                "forecast": found[address],
                "start": expected.starts.get(address),
                "seconds": seconds.get(address),
                "after": sorted(graph[address].upstream),
            }
            for address in order
        ]
        print(json.dumps(rows, indent=2))
        return
    for address in order:
        took = f", {clock(seconds[address])}" if address in seconds and address not in done else ""
        ahead = sorted(graph[address].upstream)
        after = f", after {some(ahead)}" if ahead and address not in done else ""
        print(f"{found[address]:9}  {address}{took}{after}")


def _print_plan(
    graph: "Graph", known: "Durations", table: Path | None, counts: list[int], as_json: bool
) -> None:
    """Expected times of all stages, nothing cached, and the critical path of the last number of cores."""
    from anyview.parallel.durations import read_table
    from anyview.parallel.plan import simulate
    from anyview.parallel.view import clock, some

    found = read_table(table, graph) if table else {a: d for a in graph if (d := known.of(a))}
    plans = []
    for cores in counts:
        seconds = {a: each.on(graph[a].needs.on(cores).cores) for a, each in found.items()}
        plans.append(simulate(graph, seconds, cores))
    alone = {a: each.on(graph[a].needs.on(counts[0]).cores) for a, each in found.items()}
    serial = sum(alone.values())
    unmeasured = [address for address in graph if address not in found]
    if as_json:
        rows = [{"cores": p.cores, "seconds": p.seconds, "critical_path": p.path} for p in plans]
        print(json.dumps({"serial": serial, "unmeasured": unmeasured, "plans": rows}, indent=2))
        return
    print(f"one stage after another: {clock(serial)}, each with as many of {counts[0]} cores as it can use")
    for each in plans:
        fraction = f", {each.seconds / serial:.3f} of that" if serial else ""
        print(f"{each.cores:4} cores: {clock(each.seconds)}{fraction}")
    print(f"what decides it on {counts[-1]} cores, stage by stage:")
    for address, takes in plans[-1].path:
        print(f"  {clock(takes):>8}  {address}")
    if unmeasured:
        print(f"never measured here at this scale, so counted as 0 s: {some(unmeasured)}")
