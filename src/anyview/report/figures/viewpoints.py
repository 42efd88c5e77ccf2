"""How an agent fares by the angle between its camera and the demonstration's."""

import pandas as pd
from matplotlib.figure import Figure

from anyview.analysis.cells import label
from anyview.analysis.viewpoints import DISTANCE, SUCCESS, angles
from anyview.report.figures.imitation import errors
from anyview.report.figures.style import DASHES, PALETTE, canvas

_APART = 2.0  # degrees between the methods' marks, so that no bar hides another


def angle_curves(table: pd.DataFrame) -> Figure:
    """Success over median distance by angle, a line for each method: the table of ``viewpoints.by_angle``.

    95% intervals: Wilson above, bootstrap below.
    """
    with canvas(4.0) as (figure, (whole,)):
        whole.remove()
        above, below = figure.subplots(2, 1, sharex=True)
        for axis, metric in ((above, SUCCESS), (below, DISTANCE)):
            for index, cell in enumerate(table["cell"].unique()):
                rows = angles(table, cell, metric)
                axis.errorbar(
                    rows["angle"] + _APART * index,
                    100 * rows["value"],
                    yerr=100 * errors(rows),
                    label=label(cell),
                    color=PALETTE[index % len(PALETTE)],
                    linestyle=DASHES[index % len(DASHES)],
                    marker="o",
                    markersize=5,
                    capsize=3,
                )
            axis.set_ylim(bottom=0)
        above.set(ylim=(0, 104), ylabel="runs that succeed (%)")
        below.set(ylabel="median distance (cm)", xlabel="angle between the cameras (°)")
        below.set_xticks(sorted(angles(table, table["cell"].iloc[0], SUCCESS)["angle"]))
        figure.legend(*above.get_legend_handles_labels(), loc="outside upper right", ncols=2)
        return figure
