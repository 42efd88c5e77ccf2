"""Progress on long work: a live bar on a terminal, plain lines now and then in a log file."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

_LOG_SECONDS = 15.0


class Tracker:
    """Counts finished work and shows it. Made by ``track``."""

    def __init__(self, label: str, total: int, done: int, bar: Progress | None):
        self._label, self._total, self._done, self._first = label, total, done, done
        self._started = self._shown = time.monotonic()
        self._bar = bar
        self._task = bar.add_task(label, total=total, completed=done, note="") if bar else None

    def advance(self, count: int = 1, note: str = "") -> None:
        """Record ``count`` finished units; ``note`` (loss, samples per second) stands behind the bar."""
        self._done += count
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, advance=count, note=note)
        elif time.monotonic() - self._shown > _LOG_SECONDS or self._done >= self._total:
            self._shown = time.monotonic()
            elapsed = self._shown - self._started
            left = elapsed / max(self._done - self._first, 1) * (self._total - self._done)
            print(
                f"{self._label}: {self._done}/{self._total} ({left:.0f} s left) {note}".rstrip(), flush=True
            )


@contextmanager
def track(label: str, total: int, done: int = 0) -> Iterator[Tracker]:
    """Show progress of ``total`` units of work, ``done`` of them finished before (after a resume)."""
    if not sys.stdout.isatty():
        yield Tracker(label, total, done, None)
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}"),
    )
    with Progress(*columns, console=Console()) as bar:
        yield Tracker(label, total, done, bar)
