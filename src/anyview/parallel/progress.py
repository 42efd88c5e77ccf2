"""How far a running stage is, by what its command has said last."""

import re
from dataclasses import dataclass
from pathlib import Path

_TAIL = 4096  # bytes at the end of a log
_COUNT = re.compile(r"\b(\d+)/(\d+)\b")
_LEFT = re.compile(r"\((\d+) s left\)")
_BARS = re.compile(r"[\r\n]")


@dataclass(frozen=True)
class Progress:
    """A ``fraction`` from 0 to 1 and the seconds ``left``, each None if unknown; the ``said`` line, or ""."""

    fraction: float | None
    left: float | None
    said: str


def read_progress(log: Path, elapsed: float, expected: float | None) -> Progress:
    """Progress of a stage that has run for ``elapsed`` seconds and took ``expected`` ones before.

    A line with ``done/total``, of any program, gives the fraction; ``(12 s left)`` in it, the time.
    """
    for line in reversed(_BARS.split(_tail(log))):
        count = _COUNT.search(line)
        if count and int(count[1]) <= int(count[2]) > 0:
            fraction = int(count[1]) / int(count[2])
            told = _LEFT.search(line)
            if told:
                return Progress(fraction, float(told[1]), line.strip())
            left = elapsed / fraction - elapsed if fraction else expected
            return Progress(fraction, left, line.strip())
    if expected:
        return Progress(min(elapsed / expected, 0.99), max(expected - elapsed, 0.0), "")
    return Progress(None, None, "")


def _tail(path: Path) -> str:
    try:
        with path.open("rb") as file:
            file.seek(max(0, path.stat().st_size - _TAIL))
            return file.read().decode(errors="replace")
    except OSError:
        return ""
