"""Figures 19 and 20 and what explains them: differences, learning curves, returns, the 2x2."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from anyview.report import cells as names
from anyview.report.comparisons import Comparison
from anyview.report.estimates import Estimate
from anyview.report.figures.style import (
    BLUE,
    DASHES,
    GREEN,
    INK,
    QUIET,
    SKY,
    THESIS,
    VERMILLION,
    canvas,
    mathtext,
)


@dataclass(frozen=True)
class Bar:
    """A cell's estimate, and what the thesis has for it (None where it is silent)."""

    cell: str
    estimate: Estimate
    thesis: float | None = None


def success(bars: Sequence[Bar]) -> Figure:
    """Success rates with Wilson intervals, and the thesis's rates as diamonds."""
    with canvas(0.36 * len(bars) + 1.0) as (figure, (axis,)):
        places = np.arange(len(bars))
        values, errors = _values_and_errors(bars)
        axis.barh(places, 100 * values, height=0.62, color=SKY, label="here")
        axis.errorbar(
            100 * values, places, xerr=100 * errors, fmt="none", ecolor=INK, capsize=3, label="95% (Wilson)"
        )
        stated = [
            (100 * bar.thesis, place)
            for place, bar in zip(places, bars, strict=True)
            if bar.thesis is not None
        ]
        if stated:
            axis.plot(
                *zip(*stated, strict=True),
                linestyle="none",
                label="thesis",
                clip_on=False,
                zorder=4,
                **THESIS,
            )
        axis.spines["left"].set_visible(False)
        axis.set_yticks(places, [_label(bar.cell) for bar in bars])
        axis.set(xlim=(-2.5, 100), xlabel="runs that succeed (%)")
        _tidy_rows(axis, len(bars))
        figure.legend(loc="outside upper right", ncols=3)
        return figure


def differences(comparisons: Sequence[Comparison]) -> Figure:
    """Paired differences of final distance against `ours`; coloured where an order may be claimed."""
    with canvas(0.34 * len(comparisons) + 1.0) as (figure, (axis,)):
        axis.axvline(0, color=QUIET, linewidth=1)
        for place, entry in enumerate(comparisons):
            size = entry.difference
            color, marker = QUIET, "o"
            if entry.ordered:
                color, marker = (VERMILLION, ">") if size.value > 0 else (GREEN, "<")
            axis.plot([100 * size.low, 100 * size.high], [place, place], color=color, linewidth=2.2)
            axis.plot(100 * size.value, place, marker=marker, color=color, markersize=7)
        axis.set_yticks(range(len(comparisons)), [_label(entry.cell) for entry in comparisons])
        axis.set(xlabel="cm farther than ours (mean, 95%)", title="Nearer  ←  ours  →  farther")
        _tidy_rows(axis, len(comparisons))
        return figure


def learning(
    curves: Mapping[str, pd.DataFrame], reference: str, measure: str, unit: str, scale: float
) -> Figure:
    """Small multiples: median and quartiles of ``measure`` over the runs, `reference` in grey behind.

    Each table has columns ``iteration, run`` and ``measure``.
    """
    rows = -(-len(curves) // 2)
    with canvas(1.3 * rows + 0.5) as (figure, (whole,)):
        whole.remove()
        grid = figure.subplots(rows, 2, sharex=True, sharey=True, squeeze=False)
        for axis, (cell, curve) in zip(grid.flat, curves.items(), strict=False):
            if reference in curves and cell != reference:
                median = curves[reference].groupby("iteration")[measure].median()
                axis.plot(median.index, scale * median, color=QUIET, linewidth=1, linestyle="--")
            quartiles = scale * curve.groupby("iteration")[measure].quantile([0.25, 0.5, 0.75]).unstack()
            axis.fill_between(
                quartiles.index, quartiles[0.25], quartiles[0.75], color=SKY, alpha=0.45, linewidth=0
            )
            axis.plot(quartiles.index, quartiles[0.5], color=BLUE)
            axis.set_title(_label(cell), fontsize=9, fontweight="normal")
        for axis in list(grid.flat)[len(curves) :]:
            axis.set_visible(False)
        figure.supxlabel("iteration", fontsize=9.5)
        figure.supylabel(f"{measure.replace('_', ' ')} ({unit})", fontsize=9.5)
        return figure


def returns(shares: Mapping[str, tuple[Estimate, Estimate]]) -> Figure:
    """What the arm without the object, and the policy, win of what the expert's motion earns, with intervals.

    As shares of the expert's gain over standing still, (arm, policy) for each cell.
    """
    with canvas(0.38 * len(shares) + 1.05) as (figure, (axis,)):
        styles = (("arm without object", "s", VERMILLION, -0.12), ("policy", "o", BLUE, 0.12))
        axis.axvline(0, color=QUIET, linewidth=1)
        axis.axvline(1, color=QUIET, linewidth=1)
        for place, both in enumerate(shares.values()):
            for share, (name, marker, color, shift) in zip(both, styles, strict=True):
                axis.errorbar(
                    share.value,
                    place + shift,
                    xerr=[[share.value - share.low], [share.high - share.value]],
                    fmt=marker,
                    color=color,
                    markersize=6,
                    capsize=3,
                    label=name if place == 0 else None,
                )
        axis.set_yticks(range(len(shares)), [_label(cell) for cell in shares])
        axis.set(xlabel="return (0: standing still, 1: expert), 95%")
        _tidy_rows(axis, len(shares))
        figure.legend(loc="outside upper right", ncols=2)
        return figure


def factorial(bars: Mapping[tuple[str, str], Bar]) -> Figure:
    """The 2x2: mean final distance for (contexts, learner), lines for the learners."""
    with canvas(2.7) as (figure, (axis,)):
        contexts = ("narrow", "diverse")
        for index, learner in enumerate(("TRPO", "DDPG")):
            cells = [bars[context, learner] for context in contexts]
            places = np.arange(2) + 0.04 * (index - 0.5)
            values, errors = (100 * array for array in _values_and_errors(cells))
            color, dash = (VERMILLION, BLUE)[index], DASHES[1 - index]
            axis.errorbar(
                places, values, yerr=errors, color=color, linestyle=dash, marker="os"[index], capsize=3
            )
            axis.annotate(
                learner, (places[1], values[1]), (8, 0), textcoords="offset points", color=color, va="center"
            )
        axis.set_xticks([0, 1], ["narrow contexts", "diverse contexts"])
        axis.set(ylabel="mean final distance (cm)", xlim=(-0.3, 1.45))
        axis.set_ylim(bottom=0)
        axis.grid(axis="x", visible=False)
        return figure


def _label(cell: str) -> str:
    return mathtext(names.label(cell))


def _values_and_errors(bars: Sequence[Bar]) -> tuple[np.ndarray, np.ndarray]:
    """Values (n,), and how far their bounds lie below and above them (2, n)."""
    values = np.array([bar.estimate.value for bar in bars])
    bounds = np.array([[bar.estimate.low, bar.estimate.high] for bar in bars]).T
    return values, np.abs(bounds - values)


def _tidy_rows(axis, count: int) -> None:
    axis.set_ylim(count - 0.4, -0.6)
    axis.grid(axis="y", visible=False)
    axis.tick_params(axis="y", length=0)
