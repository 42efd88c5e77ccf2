"""What fewer clips do to an agent, and clips that lack frames."""

from collections.abc import Sequence

import pandas as pd
from matplotlib.figure import Figure

from anyview.analysis.clips import DISTANCE, SUCCESS
from anyview.report.figures.imitation import errors
from anyview.report.figures.style import BLUE, INK, canvas


def clip_curves(table: pd.DataFrame, curves: Sequence[tuple[str, dict[str, str]]]) -> Figure:
    """Success over median distance, a column for each curve: its title, and the label of each cell.

    ``table`` is the one of ``analysis.clips.by_clips``. 95% intervals: Wilson above, bootstrap below.
    """
    with canvas(4.0) as (figure, (whole,)):
        whole.remove()
        grid = figure.subplots(2, len(curves), sharex="col", sharey="row", squeeze=False)
        for column, (title, labels) in enumerate(curves):
            for axis, metric in zip(grid[:, column], (SUCCESS, DISTANCE), strict=True):
                rows = table[table["metric"] == metric].set_index("cell").loc[list(labels)]
                axis.errorbar(
                    range(len(rows)),
                    100 * rows["value"],
                    yerr=100 * errors(rows),
                    color=BLUE,
                    ecolor=INK,
                    marker="o",
                    markersize=5,
                    capsize=3,
                )
                axis.set_ylim(bottom=0)
            grid[0, column].set_title(title)
            grid[1, column].set_xticks(range(len(labels)), list(labels.values()))
        grid[0, 0].set(ylim=(0, 104), ylabel="runs that succeed (%)")
        grid[1, 0].set(ylabel="median distance (cm)")
        return figure
