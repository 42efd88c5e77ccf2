"""Numbers as text: few digits, thousands apart, always with their unit; nothing that breaks over a line."""

import re
from collections.abc import Iterable

ABSENT = "–"
NOT_STATED = "not stated"

_SUBSCRIPT = re.compile(r"\bL_(\w+)")


def number(value: float) -> str:
    """Four significant digits: 11,560; 0.0123; 15."""
    if abs(value) >= 1000:
        text = f"{float(f'{value:.4g}'):,.0f}"
    else:
        text = f"{value:.4g}" if value == 0 or abs(value) >= 0.001 else f"{value:.1e}"
    return text.replace("-", "−")


def published(value: float) -> str:
    """A number of the thesis, every digit of it: 47,564."""
    return f"{value:,}"


def spread(value: float, low: float, high: float) -> str:
    """A value with its 95% bounds: 23.1 [21.8, 24.4]; alone where it comes from a single draw."""
    if low == high:
        return number(value)
    return _unbroken(f"{number(value)} [{number(low)}, {number(high)}]")


def percent(share: float) -> str:
    """A share in percent: 86.7%."""
    return f"{100 * share:.3g}%"


def percent_spread(share: float, low: float, high: float) -> str:
    """A share with its 95% bounds: 97.5% [87.1, 99.6]."""
    return _unbroken(f"{percent(share)} [{100 * low:.3g}, {100 * high:.3g}]")


def rate_spread(share: float, low: float, high: float) -> str:
    """The same for the share of a few runs, whose bounds need no more than whole percents: 86.7% [62, 96]."""
    return _unbroken(f"{percent(share)} [{100 * low:.0f}, {100 * high:.0f}]")


def centimetres(metres: float) -> str:
    """A length: 4.1 cm."""
    return _unbroken(f"{100 * metres:.1f} cm")


def centimetres_spread(metres: float, low: float, high: float) -> str:
    """A length with its 95% bounds: 4.1 cm [1.2, 7.0]."""
    return _unbroken(f"{100 * metres:.1f} cm [{100 * low:.1f}, {100 * high:.1f}]")


def probability(p: float) -> str:
    """A p-value: 0.06, or < 0.001."""
    return "< 0.001" if p < 0.001 else f"{p:.2g}"


def listed(items: Iterable[str]) -> str:
    """``a``, ``a and b``, ``a, b and c``."""
    *most, last = items
    return f"{', '.join(most)} and {last}" if most else last


def plural(count: int, noun: str) -> str:
    """``1 run``, ``15 runs``, ``4,000 clips``."""
    return f"{count:,} {noun}" + ("" if count == 1 else "s")


def subscripts(text: str, pattern: str) -> str:
    """``L_tr`` written as ``pattern`` says, for example ``L<sub>{}</sub>``."""
    return _SUBSCRIPT.sub(lambda match: pattern.format(match[1]), text)


def _unbroken(text: str) -> str:
    return text.replace("-", "−").replace(" ", "\u00a0")
