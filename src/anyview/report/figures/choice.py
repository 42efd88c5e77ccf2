"""Where the object ends when the demonstration chooses between two goals."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from anyview.report.figures.imitation import errors, name_rows
from anyview.report.figures.style import BLUE, INK, ORANGE, canvas


def choices(table: pd.DataFrame) -> Figure:
    """Runs that end at the goal that was shown and at the other one, with Wilson intervals: a tidy table."""
    cells = list(table["cell"].unique())
    with canvas(0.5 * len(cells) + 1.0) as (figure, (axis,)):
        for metric, name, color, shift in (
            ("shown_rate", "goal that was shown", BLUE, -0.19),
            ("other_rate", "other goal", ORANGE, 0.19),
        ):
            rows = table[table["metric"] == metric]
            places = np.arange(len(cells)) + shift
            axis.barh(places, 100 * rows["value"], height=0.34, color=color, label=name)
            axis.errorbar(
                100 * rows["value"], places, xerr=100 * errors(rows), fmt="none", ecolor=INK, capsize=3
            )
        axis.spines["left"].set_visible(False)
        name_rows(axis, cells)
        axis.set(xlim=(-2.5, 100), xlabel="runs that end within 2 cm (%), 95% (Wilson)")
        figure.legend(loc="outside upper right", ncols=2)
        return figure
