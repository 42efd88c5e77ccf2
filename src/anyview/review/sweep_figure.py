"""A sweep as one picture: each metric over the values of one key, with 95% intervals."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from anyview.report.figures.style import BLUE, QUIET, canvas
from anyview.review.sweeps import Sweep, is_number

_WORDS = {
    "success_rate": ("runs that succeed (%)", 100),
    "final_distance_median": ("final distance, median (cm)", 100),
}
_WIDE = 20  # largest value over smallest from which an axis is logarithmic


def sweep(content: Sweep) -> Figure:
    """One panel for each metric. The open marker is the commit that the experiments started from."""
    values = [experiment.value for experiment in content.experiments]
    numeric = all(map(is_number, values))
    places = np.asarray(values, float) if numeric else np.arange(len(values), dtype=float)
    with canvas(2.1 * len(content.metrics) + 0.6, rows=len(content.metrics), sharex=True) as (figure, axes):
        if numeric:
            _scale(axes[-1], places)
        for axis, metric in zip(axes, content.metrics, strict=True):
            _panel(axis, content, metric, places)
        axes[-1].set_xticks(np.unique(places), list(dict.fromkeys(map(_shown, values))))
        axes[-1].set_xlabel(content.key)
        if axes[0].get_legend_handles_labels()[1]:
            figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper right")
        return figure


def _panel(axis: Axes, content: Sweep, metric: str, places: np.ndarray) -> None:
    where, _, name = metric.rpartition(".")
    words, scale = _WORDS.get(name, (name.replace("_", " "), 1))
    measured = [experiment.metrics[metric] for experiment in content.experiments]
    means = scale * np.array([each.value for each in measured])
    bounds = [(each.value,) * 2 if each.low is None else (each.low, each.high) for each in measured]
    errors = np.abs(scale * np.array(bounds, float).T - means)
    axis.plot(places, means, color=QUIET, linewidth=1, linestyle="--", zorder=1)
    axis.errorbar(places, means, yerr=errors, color=BLUE, fmt="o", capsize=3)
    for place, mean, experiment in zip(places, means, content.experiments, strict=True):
        if experiment.name == content.base:
            axis.plot(
                place, mean, "o", color=BLUE, markerfacecolor="white", zorder=3, label="the commit itself"
            )
    axis.set(title=where, ylabel=words)
    if name == "success_rate":
        axis.set_ylim(-3, 103)
    else:
        axis.margins(y=0.12)


def _scale(axis: Axes, places: np.ndarray) -> None:
    """Logarithmic if the values span much, and linear from the smallest to 0."""
    sizes = np.abs(places[places != 0])
    if len(sizes) and sizes.max() / sizes.min() >= _WIDE:
        axis.set_xscale("symlog", linthresh=sizes.min())
        axis.minorticks_off()


def _shown(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
