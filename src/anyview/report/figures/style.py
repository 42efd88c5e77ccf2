"""One look for every figure: the Okabe-Ito palette, quiet axes, SVG that depends on the data alone."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from anyview.report.formatting import subscripts

INK = "#1b1f24"
QUIET = "#6b7280"
GRID = "#e5e7eb"
BLUE = "#0072B2"
ORANGE = "#E69F00"
GREEN = "#009E73"
VERMILLION = "#D55E00"
SKY = "#56B4E9"
PURPLE = "#CC79A7"
PALETTE = (BLUE, VERMILLION, GREEN, ORANGE, PURPLE, SKY, INK)
"""Okabe and Ito (2008): told apart with any colour vision. Lines differ in dash as well, for print."""
DASHES = ("-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1)), (0, (1, 1)))

THESIS: dict[str, Any] = {
    "color": VERMILLION,
    "marker": "D",
    "markerfacecolor": "white",
    "markeredgewidth": 1.4,
}
"""How a number of the thesis looks wherever it stands: an open vermillion diamond."""

WIDTH = 4.6
"""Inches. Narrow on purpose: at a phone's width the text still measures 10 pixels."""

_RC: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.edgecolor": QUIET,
    "axes.formatter.use_mathtext": False,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "xtick.color": QUIET,
    "ytick.color": QUIET,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "text.color": INK,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.6,
    "figure.constrained_layout.use": True,
    "svg.fonttype": "path",
    "svg.hashsalt": "anyview",
}


@contextmanager
def canvas(height: float, rows: int = 1, **options) -> Iterator[tuple[Figure, list[Axes]]]:
    """A figure of the common width and its axes, one under another, drawn in the common style."""
    with plt.rc_context(_RC):
        figure, axes = plt.subplots(rows, 1, figsize=(WIDTH, height), squeeze=False, **options)
        try:
            yield figure, list(axes[:, 0])
        finally:
            plt.close(figure)


def mathtext(text: str) -> str:
    """``L_tr`` with a subscript."""
    return subscripts(text, r"$L_{{\mathrm{{{}}}}}$")


def to_png(figure: Figure) -> bytes:
    """``figure`` as a PNG file's bytes, at twice a screen's resolution."""
    buffer = io.BytesIO()
    with plt.rc_context(_RC):
        figure.savefig(buffer, format="png", dpi=200, metadata={"Software": None})
    return buffer.getvalue()


def to_svg(figure: Figure) -> str:
    """``figure`` as SVG text: the same text for the same data."""
    buffer = io.StringIO()
    with plt.rc_context(_RC):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return buffer.getvalue()
