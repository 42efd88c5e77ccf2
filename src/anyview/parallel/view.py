"""What the user sees of a run: a live table on a terminal, plain lines in a log, or JSON for a script."""

import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from anyview.parallel.progress import Progress
from anyview.parallel.stage import Result

_LOG_SECONDS = 60.0
_JSON_SECONDS = 1.0
_LIVE_SECONDS = 0.4
_BAR = 16  # characters
_NAMED = 3  # stages named in a row, before "and 4 more"


@dataclass(frozen=True)
class Moment:
    """The run as it is now: stages running, waiting and done.

    ``running`` has each stage's seconds since its start and progress, ``waiting`` what each stage waits for.
    ``left`` are the seconds to the end by the critical path; stages that nobody has measured are not in it,
    and ``unmeasured`` says how many these are.
    """

    running: dict[str, tuple[float, Progress]]
    waiting: dict[str, list[str]]
    done: int
    total: int
    left: float
    unmeasured: int


class View(Protocol):
    """Shows a run."""

    def started(self, address: str) -> None: ...
    def ended(self, result: Result, skipped: Sequence[str]) -> None: ...
    def tick(self, look: Callable[[], Moment]) -> None: ...
    def close(self) -> None: ...


def make_view(as_json: bool) -> View:
    """The view that fits the output."""
    if as_json:
        return JsonView()
    return LiveView() if sys.stdout.isatty() else PlainView()


def clock(seconds: float) -> str:
    """Seconds as a short text: 0.4 s, 42 s, 12 min, 3.5 h."""
    if seconds < 10:
        return f"{seconds:.1f} s"
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def some(names: Sequence[str]) -> str:
    """The first of ``names``, and how many more there are."""
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more


def headline(moment: Moment) -> str:
    """One line about the whole."""
    text = (
        f"{moment.done} of {moment.total} stages done, {len(moment.running)} run, {len(moment.waiting)} wait"
    )
    if moment.unmeasured:
        least = f"at least {clock(moment.left)} and " if moment.left else ""
        return f"{text}; left: {least}{moment.unmeasured} stages never measured"
    return f"{text}; {clock(moment.left)} left by the critical path"


def ending(result: Result) -> str:
    """One line about the end of a stage."""
    took = f" in {clock(result.seconds)}" if result.seconds else ""
    return f"{result.address}: {result.state}{took}" + (f": {result.message}" if result.message else "")


class PlainView:
    """A line at each start and end, and every minute how far the running ones are."""

    def __init__(self) -> None:
        self._shown = time.monotonic()

    def started(self, address: str) -> None:
        print(f"{address}: started", flush=True)

    def ended(self, result: Result, skipped: Sequence[str]) -> None:
        print(ending(result), flush=True)
        for address in skipped:
            print(f"{address}: skipped, because {result.address} did not finish", flush=True)

    def tick(self, look: Callable[[], Moment]) -> None:
        if time.monotonic() - self._shown < _LOG_SECONDS:
            return
        self._shown = time.monotonic()
        moment = look()
        for address, (_, progress) in moment.running.items():
            said = ", ".join(part for part in _parts(progress) if part)
            print(f"{address}: {said or 'running'}", flush=True)
        print(headline(moment), flush=True)

    def close(self) -> None:
        pass


class JsonView:
    """An object a line: ``event`` is started, ended or progress."""

    def __init__(self) -> None:
        self._shown = time.monotonic()

    def _say(self, event: str, **values: object) -> None:
        print(json.dumps({"event": event, **values}), flush=True)

    def started(self, address: str) -> None:
        self._say("started", stage=address)

    def ended(self, result: Result, skipped: Sequence[str]) -> None:
        self._say(
            "ended",
            stage=result.address,
            state=result.state,
            seconds=round(result.seconds, 3),
            message=result.message,
            skipped=list(skipped),
        )

    def tick(self, look: Callable[[], Moment]) -> None:
        if time.monotonic() - self._shown < _JSON_SECONDS:
            return
        self._shown = time.monotonic()
        moment = look()
        running = {
            address: {"seconds": round(elapsed, 1), "fraction": progress.fraction, "left": progress.left}
            for address, (elapsed, progress) in moment.running.items()
        }
        self._say(
            "progress",
            running=running,
            waiting=moment.waiting,
            done=moment.done,
            total=moment.total,
            left=round(moment.left, 1),
            unmeasured=moment.unmeasured,
        )

    def close(self) -> None:
        pass


class LiveView:
    """A table that is drawn anew, without a thread: the scheduler forks."""

    def __init__(self) -> None:
        self._console = Console(highlight=False)
        self._live = Live(console=self._console, auto_refresh=False, transient=True)
        self._live.start()
        self._shown = 0.0

    def started(self, address: str) -> None:
        pass  # it stands in the table

    def ended(self, result: Result, skipped: Sequence[str]) -> None:
        self._console.print(ending(result), markup=False)
        if skipped:
            self._console.print(f"  skipped: {some(skipped)}", markup=False)

    def tick(self, look: Callable[[], Moment]) -> None:
        if time.monotonic() - self._shown < _LIVE_SECONDS:
            return
        self._shown = time.monotonic()
        moment = look()
        room = max(self._console.size.height - len(moment.running) - 3, 0)
        waiting = [Text(line, "dim", no_wrap=True, overflow="ellipsis") for line in _waiting(moment)[:room]]
        whole = Text(headline(moment), "bold")
        self._live.update(Group(self._running(moment), *waiting, whole), refresh=True)

    def _running(self, moment: Moment) -> Table:
        """A line a stage, however narrow the terminal is."""
        table = Table.grid(padding=(0, 1), expand=True)
        table.add_column(no_wrap=True, overflow="ellipsis", max_width=self._console.width // 3)
        table.add_column(width=_BAR)
        for _ in ("elapsed", "fraction", "left"):
            table.add_column(no_wrap=True, justify="right")
        table.add_column(no_wrap=True, overflow="ellipsis", ratio=1)
        for address, (elapsed, progress) in moment.running.items():
            fraction, left, said = _parts(progress)
            bar = _bar(progress.fraction)
            table.add_row(Text(address), bar, clock(elapsed), fraction, left, Text(f" {said}", "dim"))
        return table

    def close(self) -> None:
        self._live.stop()


def _waiting(moment: Moment) -> list[str]:
    """A line for all stages that wait for the same."""
    together: dict[tuple[str, ...], list[str]] = {}
    for address, upstream in moment.waiting.items():
        together.setdefault(tuple(upstream), []).append(address)
    return [
        f"{some(addresses)} {'wait' if len(addresses) > 1 else 'waits'} for {some(upstream) or 'room'}"
        for upstream, addresses in together.items()
    ]


def _parts(progress: Progress) -> tuple[str, str, str]:
    fraction = "" if progress.fraction is None else f"{100 * progress.fraction:.0f}%"
    left = "" if progress.left is None else f"{clock(progress.left)} left"
    return fraction, left, progress.said


def _bar(fraction: float | None) -> str:
    if fraction is None:
        return "·" * _BAR
    full = round(fraction * _BAR)
    return "█" * full + "░" * (_BAR - full)
