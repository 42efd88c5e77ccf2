"""How far policies end from the goal, by how diverse the contexts of their translator were."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from anyview.report.figures.style import DASHES, PALETTE, QUIET, canvas

TITLES = {"own": "Contexts and clips as trained on", "diverse": "Any context, any clip"}


def by_views(rates: pd.DataFrame) -> Figure:
    """Final distance over viewpoints, a panel an evaluation; bars reach from one translator to another."""
    evaluations = list(rates["evaluation"].unique())
    views = list(rates["views"].unique())
    with canvas(2.1 * len(evaluations) + 0.6, rows=len(evaluations), sharey=True) as (figure, axes):
        for axis, evaluation in zip(axes, evaluations, strict=True):
            _by_views(axis, rates[rates["evaluation"] == evaluation], views)
            axis.set(title=TITLES[evaluation], yscale="log", ylabel="final distance (cm)")
            _plain(axis)
            axis.axhline(2, color=QUIET, linewidth=0.8)
        axes[-1].set_xlabel("viewpoints of the translator's training")
        axes[0].legend(fontsize=7.5, ncols=2)
        return figure


def by_angle(points: pd.DataFrame) -> Figure:
    """How many times as far as with the most viewpoints, by the angle to the nearest: a point a context."""
    with canvas(2.6) as (figure, (axis,)):
        for place, views in enumerate(points["views"].unique()):
            rows = points[points["views"] == views]
            axis.scatter(
                rows["angle"],
                rows["ratio"],
                s=14,
                color=PALETTE[place % len(PALETTE)],
                marker="os^D"[place % 4],
                label=f"{views} view" if views == "1" else f"{views} views",
            )
        axis.set(yscale="log", ylabel="times as far")
        _plain(axis)
        axis.axhline(1, color=QUIET, linewidth=0.8)
        axis.set_xticks(range(0, 181, 45))
        axis.set_xlabel("degrees from the agent's viewpoint to the nearest in training")
        axis.legend(fontsize=7.5, ncols=2)
        return figure


def _plain(axis: Axes) -> None:
    axis.yaxis.set_major_formatter("{x:g}")
    axis.yaxis.set_minor_formatter("")


def _by_views(axis: Axes, rates: pd.DataFrame, views: list[str]) -> None:
    """A line for each number of demonstrations with distractors and one without."""
    groups = list(rates.groupby(["demonstrations", "clutter"], sort=False))
    counts = list(rates["demonstrations"].unique())
    for place, ((demonstrations, clutter), rows) in enumerate(groups):
        rows = rows.set_index("views").reindex(views)
        bounds = rows[["nearest", "farthest"]].to_numpy(float)
        axis.errorbar(
            np.arange(len(views)) + 0.2 * ((place + 0.5) / len(groups) - 0.5),
            100 * rows["distance"],
            yerr=100 * np.abs(bounds - rows[["distance"]].to_numpy(float)).T,
            color=PALETTE[counts.index(demonstrations) % len(PALETTE)],
            linestyle=DASHES[clutter == "plain"],
            marker="o",
            markersize=3,
            elinewidth=0.8,
            label=f"{int(demonstrations):,}, {clutter}",
        )
    axis.set_xticks(range(len(views)), views)
    axis.grid(axis="x", visible=False)
