"""Numbers as text: few digits, thousands apart, always with their unit; nothing that breaks over a line.

An estimate is anything with ``value``, ``low`` and ``high``, such as a row of a tidy table.
"""

import math
import re
from collections.abc import Iterable
from typing import Protocol

ABSENT = "–"
NOT_STATED = "not stated"

_SUBSCRIPT = re.compile(r"\bL_(\w+)")


class Bounded(Protocol):
    """A value with its 95% bounds; they are NaN where it has none."""

    value: float
    low: float
    high: float


class Ratio(Protocol):
    """A contrast on the log scale, as ``comparisons`` has it."""

    ratio: float
    ratio_low: float
    ratio_high: float


def number(value: float) -> str:
    """Four significant digits: 11,560; 0.0123; 15."""
    if abs(value) >= 1000:
        text = f"{float(f'{value:.4g}'):,.0f}"
    else:
        text = f"{value:.4g}" if value == 0 or abs(value) >= 0.001 else f"{value:.1e}"
    return _unbroken(text)


def count(value: float) -> str:
    """A whole number, every digit of it: 4,000."""
    return f"{value:,.0f}"


def published(value: float, absent: str = NOT_STATED) -> str:
    """A whole number of the thesis, every digit of it: 47,564. ``absent`` where it states none (NaN)."""
    return absent if math.isnan(value) else f"{value:,.0f}"


def spread(found: Bounded) -> str:
    """A value with its 95% bounds: 23.1 [21.8, 24.4]; alone where it comes from a single draw."""
    if math.isnan(found.low) or found.low == found.high:
        return number(found.value)
    return _unbroken(f"{number(found.value)} [{number(found.low)}, {number(found.high)}]")


def percent(fraction: float | None) -> str:
    """A fraction in percent: 86.7%."""
    return ABSENT if fraction is None else f"{100 * fraction:.3g}%"


def whole_percent(fraction: float) -> str:
    """A fraction in whole percents, without the sign: 87."""
    return f"{100 * fraction:.0f}"


def percent_spread(found: Bounded) -> str:
    """A fraction with its 95% bounds: 97.5% [87.1, 99.6]."""
    return _unbroken(f"{percent(found.value)} [{100 * found.low:.3g}, {100 * found.high:.3g}]")


def rate_spread(value: float, low: float, high: float) -> str:
    """A fraction of few runs, whose bounds need no more than whole percents: 86.7% [62, 96]."""
    if math.isnan(value):
        return ABSENT
    return _unbroken(f"{percent(value)} [{whole_percent(low)}, {whole_percent(high)}]")


def centimetres(metres: float) -> str:
    """A length: 4.1 cm."""
    return _unbroken(f"{100 * metres:.1f} cm")


def centimetres_spread(found: Bounded) -> str:
    """A length with its 95% bounds: 4.1 cm [1.2, 7.0]."""
    return _unbroken(f"{centimetres(found.value)} [{100 * found.low:.1f}, {100 * found.high:.1f}]")


def times(found: Ratio) -> str:
    """How many times as far, with its 95% bounds: 2.4 [1.3, 4.2]."""
    return _unbroken(f"{found.ratio:.2g} [{found.ratio_low:.2g}, {found.ratio_high:.2g}]")


def probability(p: float) -> str:
    """A p-value: 0.06, or < 0.001."""
    return "< 0.001" if p < 0.001 else f"{p:.2g}"


def listed(items: Iterable[str]) -> str:
    """``a``, ``a and b``, ``a, b and c``."""
    *most, last = items
    return f"{', '.join(most)} and {last}" if most else last


def plural(count: float, noun: str) -> str:
    """``1 run``, ``15 runs``, ``4,000 clips``."""
    return f"{count:,.0f} {noun}" + ("" if count == 1 else "s")


def subscripts(text: str, pattern: str) -> str:
    """``L_tr`` written as ``pattern`` says, for example ``L<sub>{}</sub>``."""
    return _SUBSCRIPT.sub(lambda match: pattern.format(match[1]), text)


def _unbroken(text: str) -> str:
    return text.replace("-", "−").replace(" ", "\u00a0")
