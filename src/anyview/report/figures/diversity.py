"""How far policies end from the goal, by how diverse the contexts of their translator were."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from anyview.report.figures.style import DASHES, PALETTE, QUIET, canvas

TITLES = {
    "own": "Contexts and clips as trained on",
    "contexts": "Any context, clips as trained on",
    "diverse": "Any context, any clip",
}


def diversity(rates: pd.DataFrame, angles: pd.DataFrame) -> Figure:
    """Final distance over viewpoints, a panel an evaluation; below it over the angle to the nearest one.

    The angle counts where the context is any, and if possible the clips are as trained on.
    """
    evaluations = list(rates["evaluation"].unique())
    in_any_context = [evaluation for evaluation in evaluations if evaluation != "own"][:1]
    panels = len(evaluations) + len(in_any_context)
    with canvas(2.1 * panels + 0.6, rows=panels, sharey=True) as (figure, axes):
        views = list(rates["views"].unique())
        for axis, evaluation in zip(axes, evaluations, strict=False):
            _by_views(axis, rates[rates["evaluation"] == evaluation], views)
            axis.set_title(TITLES[evaluation])
        axes[len(evaluations) - 1].set_xlabel("viewpoints of the translator's training")
        axes[0].legend(fontsize=7.5, ncols=2)
        for axis, evaluation in zip(axes[len(evaluations) :], in_any_context, strict=True):
            _by_angle(axis, angles[angles["evaluation"] == evaluation])
            axis.set_title(f"{TITLES[evaluation]}, by the angle")
        for axis in axes:
            axis.set(yscale="log", ylabel="final distance (cm)")
            axis.yaxis.set_major_formatter("{x:g}")
            axis.yaxis.set_minor_formatter("")
            axis.axhline(2, color=QUIET, linewidth=0.8)
        return figure


def _by_views(axis: Axes, rates: pd.DataFrame, views: list[str]) -> None:
    """A line for each number of demonstrations with distractors and one without, with intervals."""
    groups = list(rates.groupby(["demonstrations", "clutter"], sort=False))
    counts = list(rates["demonstrations"].unique())
    for place, ((demonstrations, clutter), rows) in enumerate(groups):
        rows = rows.set_index("views").reindex(views)
        bounds = rows[["distance_low", "distance_high"]].to_numpy(float)
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


def _by_angle(axis: Axes, angles: pd.DataFrame) -> None:
    """A line for each number of viewpoints, over all translators that have it."""
    for place, (views, rows) in enumerate(angles.groupby("views", sort=False)):
        axis.plot(
            rows["angle"],
            100 * rows["distance"],
            color=PALETTE[place % len(PALETTE)],
            marker="o",
            markersize=3,
            label=f"{views} view" if views in ("1", "any") else f"{views} views",
        )
    axis.set_xticks(range(0, 181, 45))
    axis.set_xlabel("degrees from the agent's viewpoint to the nearest in training")
    axis.legend(fontsize=7.5, ncols=2)
