"""Figure 20 with several translators of each loss: success and learning curves, under each reward."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from anyview.analysis.cells import label
from anyview.report.figures.style import DASHES, PALETTE, THESIS, canvas, mathtext


def success(rates: pd.DataFrame) -> Figure:
    """Success rates with intervals over translators and contexts, a colour for each reward; the thesis's."""
    cells = list(rates["cell"].unique())
    rewards = list(rates["reward"].unique())
    with canvas(0.6 * len(cells) + 1.1) as (figure, (axis,)):
        for index, reward in enumerate(rewards):
            rows = rates[rates["reward"] == reward].set_index("cell").reindex(cells)
            places = np.arange(len(cells)) + 0.5 * ((index + 0.5) / len(rewards) - 0.5)
            axis.errorbar(
                100 * rows["value"],
                places,
                xerr=100 * np.abs(rows[["low", "high"]].to_numpy() - rows[["value"]].to_numpy()).T,
                fmt="o",
                color=PALETTE[index % len(PALETTE)],
                capsize=3,
                label=reward,
            )
        published = rates.drop_duplicates("cell").set_index("cell").reindex(cells)["thesis"]
        axis.plot(100 * published, np.arange(len(cells)), linestyle="none", label="thesis", **THESIS)
        axis.set_yticks(range(len(cells)), [mathtext(label(cell)) for cell in cells])
        axis.set_ylim(len(cells) - 0.4, -0.6)
        axis.grid(axis="y", visible=False)
        axis.set(xlim=(-2.5, 102.5), xlabel="runs that succeed (%), 95% over translators and contexts")
        figure.legend(loc="outside upper right", ncols=3)
        return figure


def learning(curves: pd.DataFrame) -> Figure:
    """Final distance over environment steps, a panel for each reward and a line for each cell."""
    rewards = list(curves["reward"].unique())
    with canvas(2.4 * len(rewards) + 0.5, rows=len(rewards), sharex=True, sharey=True) as (figure, axes):
        for axis, reward in zip(axes, rewards, strict=True):
            panel = curves[curves["reward"] == reward]
            for index, (cell, curve) in enumerate(panel.groupby("cell", sort=False)):
                axis.plot(
                    curve["steps"],
                    100 * curve["final_distance"],
                    color=PALETTE[index % len(PALETTE)],
                    linestyle=DASHES[index % len(DASHES)],
                    label=mathtext(label(cell)),
                )
            axis.set(title=reward, yscale="log", ylabel="final distance (cm)")
            axis.yaxis.set_major_formatter("{x:g}")
        axes[-1].set_xlabel("environment steps of a run")
        axes[0].legend(fontsize=8)
        return figure
