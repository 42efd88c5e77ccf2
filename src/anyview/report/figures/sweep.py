"""A sweep as one picture: each metric over the values of one key, with 95% intervals."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from anyview.report.figures.style import BLUE, QUIET, canvas
from anyview.report.sweeps import Sweep

_WORDS = {
    "success_rate": ("runs that succeed (%)", 100),
    "final_distance_median": ("final distance, median (cm)", 100),
}
_WIDE = 20  # largest value over smallest from which an axis is logarithmic


def sweep(content: Sweep) -> Figure:
    """A panel a metric, one under another; the open marker is the commit that the experiments started at."""
    values = content.values()
    numeric = all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)
    places = np.asarray(values, float) if numeric else np.arange(len(values), dtype=float)
    with canvas(2.1 * len(content.metrics) + 0.6, rows=len(content.metrics), sharex=True) as (figure, axes):
        for axis, metric in zip(axes, content.metrics, strict=True):
            _panel(axis, content, metric, places)
        if numeric:
            _scale(axes[-1], places)
        axes[-1].set_xticks(np.unique(places), list(dict.fromkeys(map(_shown, values))))
        axes[-1].set_xlabel(content.key)
        if axes[0].get_legend_handles_labels()[1]:
            figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper right")
        return figure


def _panel(axis: Axes, content: Sweep, metric: str, places: np.ndarray) -> None:
    where, _, name = metric.rpartition(".")
    words, scale = _WORDS.get(name, (name.replace("_", " "), 1))
    readings = [trial.metrics[metric] for trial in content.trials]
    means = scale * np.array([reading.value for reading in readings])
    bounds = [
        (reading.value, reading.value) if reading.low is None else (reading.low, reading.high)
        for reading in readings
    ]
    errors = np.abs(scale * np.array(bounds, float).T - means)
    axis.plot(places, means, color=QUIET, linewidth=1, linestyle="--", zorder=1)
    axis.errorbar(places, means, yerr=errors, color=BLUE, fmt="o", capsize=3)
    for place, mean, trial in zip(places, means, content.trials, strict=True):
        if trial.name == content.base:
            axis.plot(
                place, mean, "o", color=BLUE, markerfacecolor="white", zorder=3, label="the commit itself"
            )
    axis.set(title=where, ylabel=words)
    if name == "success_rate":
        axis.set_ylim(-3, 103)
    else:
        axis.margins(y=0.12)


def _scale(axis: Axes, places: np.ndarray) -> None:
    """Logarithmic where the values span much; linear up to the smallest where 0 is among them."""
    positive = places[places > 0]
    if (places < 0).any() or not len(positive) or positive.max() / positive.min() < _WIDE:
        return
    if (places == 0).any():
        axis.set_xscale("symlog", linthresh=positive.min())
    else:
        axis.set_xscale("log")
    axis.minorticks_off()


def _shown(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
