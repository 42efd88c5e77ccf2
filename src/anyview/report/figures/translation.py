"""Figures 13 to 18: training on real clips, feature weights, strips."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, NullLocator

from anyview.analysis import thesis
from anyview.report.figures.style import BLUE, INK, QUIET, SKY, THESIS, WIDTH, canvas
from anyview.report.pictures import Strip


def training(curve: pd.DataFrame, reference: thesis.PublishedRun) -> Figure:
    """Figures 13 and 14: total and validation loss over iterations, and the points that the thesis states.

    ``curve`` has columns ``iteration, loss, validation_loss``.
    """
    with canvas(4.6, rows=2, sharex=True) as (figure, axes):
        for axis, column, title, points in (
            (axes[0], "loss", "Total loss", reference.total.points()),
            (axes[1], "validation_loss", "Validation loss", reference.validation.points()),
        ):
            axis.plot(curve["iteration"], curve[column], color=BLUE, marker=".", label="here")
            axis.plot(*zip(*points, strict=True), linestyle="none", label="thesis", **THESIS)
            axis.set(title=title, yscale="log", ylabel="loss, batch of 100")
            axis.legend()
            axis.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axis.yaxis.set_major_formatter("{x:,.0f}")
            axis.yaxis.set_minor_formatter(NullFormatter())
        axes[1].set_xscale("symlog", linthresh=100)
        axes[1].set_xlim(-8, 1.3 * max(reference.iterations, curve["iteration"].max()))
        axes[1].set_xticks([0, 50, 100, 1000, 10_000])
        axes[1].xaxis.set_major_formatter("{x:,.0f}")
        axes[1].xaxis.set_minor_locator(NullLocator())
        axes[1].set_xlabel("iteration (linear to 100, then logarithmic)")
        return figure


def feature_weights(weights: pd.Series) -> Figure:
    """Figure 15: weight of each frame, (T,), beside the thesis's, scaled to the same sum of 1.

    The thesis's line has gaps where its text states nothing.
    """
    with canvas(2.8) as (figure, (axis,)):
        frames = np.arange(len(weights))
        axis.bar(frames, weights, width=1.0, color=SKY, edgecolor=BLUE, linewidth=0.3, label="here")
        if len(weights) == thesis.FRAMES:
            shape = thesis.feature_weight_shape()
            axis.step(frames, shape, where="mid", color=THESIS["color"], label="thesis, scaled to sum to 1")
        axis.set(xlabel="frame", ylabel="feature weight", xlim=(-1, len(weights)))
        axis.grid(axis="x", visible=False)
        figure.legend(loc="outside upper right", ncols=2)
        return figure


def strip(content: Strip, title: str = "") -> Figure:
    """Frames in rows with their labels and time steps, pixels kept sharp."""
    count = len(content.steps)
    aspect = len(content.rows) / count
    beside, below = 0.72, 0.62 if title else 0.4  # inches of labels
    with canvas((WIDTH - beside) * aspect + below) as (figure, (axis,)):
        picture = np.concatenate([np.concatenate(list(frames), axis=1) for _, frames in content.rows])
        height, width = content.rows[0][1].shape[1:3]
        axis.imshow(picture, interpolation="nearest")
        for column in range(1, count):
            axis.axvline(column * width - 0.5, color="white", linewidth=1)
        for row in range(1, len(content.rows)):
            axis.axhline(row * height - 0.5, color="white", linewidth=2)
        axis.set_xticks(
            [(index + 0.5) * width for index in range(count)], [str(step) for step in content.steps]
        )
        axis.set_yticks(
            [(row + 0.5) * height for row in range(len(content.rows))], [row[0] for row in content.rows]
        )
        axis.tick_params(length=0, labelcolor=INK)
        axis.set_xlabel("step", color=QUIET)
        axis.set_title(title)
        axis.grid(visible=False)
        axis.spines[:].set_visible(False)
        return figure
