"""Figures 19 and 20 and what explains them: differences, learning curves, returns, the 2x2."""

from collections.abc import Iterable

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from anyview.analysis.cells import OURS, label
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


def success(rates: pd.DataFrame) -> Figure:
    """Success rates with Wilson intervals, and the thesis's rates as diamonds: a tidy table's rows."""
    with canvas(0.36 * len(rates) + 1.0) as (figure, (axis,)):
        places = np.arange(len(rates))
        axis.barh(places, 100 * rates["value"], height=0.62, color=SKY, label="here")
        axis.errorbar(
            100 * rates["value"],
            places,
            xerr=100 * errors(rates),
            fmt="none",
            ecolor=INK,
            capsize=3,
            label="95% (Wilson)",
        )
        if rates["thesis"].notna().any():
            axis.plot(
                100 * rates["thesis"],
                places,
                linestyle="none",
                label="thesis",
                clip_on=False,
                zorder=4,
                **THESIS,
            )
        axis.spines["left"].set_visible(False)
        name_rows(axis, rates["cell"])
        axis.set(xlim=(-2.5, 100), xlabel="runs that succeed (%)")
        figure.legend(loc="outside upper right", ncols=3)
        return figure


def differences(table: pd.DataFrame) -> Figure:
    """How many times as far as `ours` each method ends; coloured where an order may be claimed."""
    styles = {"farther": (VERMILLION, ">"), "nearer": (GREEN, "<")}
    with canvas(0.34 * len(table) + 1.0) as (figure, (axis,)):
        axis.axvline(1, color=QUIET, linewidth=1)
        for place, row in enumerate(table.itertuples()):
            color, marker = styles.get(row.order, (QUIET, "o"))
            axis.plot([row.ratio_low, row.ratio_high], [place, place], color=color, linewidth=2.2)
            axis.plot(row.ratio, place, marker=marker, color=color, markersize=7)
        name_rows(axis, table["cell"])
        axis.set_xscale("log")
        axis.xaxis.set_major_formatter("{x:g}")
        axis.set(xlabel="times as far as ours (geometric mean, 95%)", title="Nearer  ←  ours  →  farther")
        return figure


def learning(table: pd.DataFrame) -> Figure:
    """Small multiples of final distance over iterations: median and quartiles, `ours` in grey behind.

    ``table`` has columns ``cell, iteration, final_distance, low, high``, in metres.
    """
    curves = {cell: curve for cell, curve in table.groupby("cell", sort=False)}
    rows = -(-len(curves) // 2)
    with canvas(1.3 * rows + 0.5) as (figure, (whole,)):
        whole.remove()
        grid = figure.subplots(rows, 2, sharex=True, sharey=True, squeeze=False)
        for axis, (cell, curve) in zip(grid.flat, curves.items(), strict=False):
            if OURS in curves and cell != OURS:
                ours = curves[OURS]
                axis.plot(
                    ours["iteration"], 100 * ours["final_distance"], color=QUIET, linewidth=1, linestyle="--"
                )
            axis.fill_between(
                curve["iteration"],
                100 * curve["low"],
                100 * curve["high"],
                color=SKY,
                alpha=0.45,
                linewidth=0,
            )
            axis.plot(curve["iteration"], 100 * curve["final_distance"], color=BLUE)
            axis.set_title(mathtext(label(cell)), fontsize=9, fontweight="normal")
        for axis in list(grid.flat)[len(curves) :]:
            axis.set_visible(False)
        figure.supxlabel("iteration", fontsize=9.5)
        figure.supylabel("final distance (cm)", fontsize=9.5)
        return figure


def returns(shares: pd.DataFrame) -> Figure:
    """What the arm without the object, and the policy, win of what the expert's motion earns.

    ``shares`` are tidy rows of ``share_arm_only`` and ``share_policy``: 0 stands still, 1 is the expert.
    """
    cells = list(shares["cell"].unique())
    with canvas(0.38 * len(cells) + 1.05) as (figure, (axis,)):
        axis.axvline(0, color=QUIET, linewidth=1)
        axis.axvline(1, color=QUIET, linewidth=1)
        for metric, name, marker, color, shift in (
            ("share_arm_only", "arm without object", "s", VERMILLION, -0.12),
            ("share_policy", "policy", "o", BLUE, 0.12),
        ):
            rows = shares[shares["metric"] == metric]
            axis.errorbar(
                rows["value"],
                np.arange(len(cells)) + shift,
                xerr=errors(rows),
                fmt=marker,
                color=color,
                markersize=6,
                capsize=3,
                label=name,
            )
        name_rows(axis, cells)
        axis.set(xlabel="return (0: standing still, 1: expert), 95%")
        figure.legend(loc="outside upper right", ncols=2)
        return figure


def factorial(table: pd.DataFrame) -> Figure:
    """The 2x2: mean final distance over the contexts, narrow and diverse, a line for each learner."""
    with canvas(2.7) as (figure, (axis,)):
        for index, learner in enumerate(("TRPO", "DDPG")):
            rows = table[table["learner"] == learner]
            places, values = np.arange(2) + 0.04 * (index - 0.5), 100 * rows["value"].to_numpy()
            color, dash = (VERMILLION, BLUE)[index], DASHES[1 - index]
            axis.errorbar(
                places,
                values,
                yerr=100 * errors(rows),
                color=color,
                linestyle=dash,
                marker="os"[index],
                capsize=3,
            )
            axis.annotate(
                learner, (places[1], values[1]), (8, 0), textcoords="offset points", color=color, va="center"
            )
        axis.set_xticks([0, 1], ["narrow contexts", "diverse contexts"])
        axis.set(ylabel="mean final distance (cm)", xlim=(-0.3, 1.45))
        axis.set_ylim(bottom=0)
        axis.grid(axis="x", visible=False)
        return figure


def errors(rows: pd.DataFrame) -> np.ndarray:
    """How far the bounds lie below and above the values, (2, n)."""
    return np.abs(rows[["low", "high"]].to_numpy() - rows[["value"]].to_numpy()).T


def name_rows(axis: Axes, cells: Iterable[str]) -> None:
    """A row for each of ``cells``, from top to bottom."""
    names = [mathtext(label(cell)) for cell in cells]
    axis.set_yticks(range(len(names)), names)
    axis.set_ylim(len(names) - 0.4, -0.6)
    axis.grid(axis="y", visible=False)
    axis.tick_params(axis="y", length=0)
