"""Tables and pictures for ``dvc plots``, drawn by the templates in .dvc/plots.

Tables are long, a row per cell and point, so that a plot's declaration in dvc.yaml names no cell.
"""

from pathlib import Path

import pandas as pd

from anyview.analysis.cells import label
from anyview.analysis.results import Results
from anyview.analysis.study import Study
from anyview.report.figures.style import to_png
from anyview.report.figures.translation import strip
from anyview.report.illustrations import idea_strip, typical_strip
from anyview.runtime.outputs import write_atomically

_POINTS = 100


def write_plots(folder: Path, study: Study, results: Results) -> None:
    """Write every table and picture that ``study`` allows into ``folder``."""
    _write(folder / "validation_loss.csv", _thin(results.losses[["cell", "iteration", "validation_loss"]]))
    _write(folder / "final_distance.csv", _thin(results.learning))
    _write(folder / "feature_weights.csv", _thin(results.feature_weights))
    rates = results.imitation[results.imitation["metric"] == "success_rate"]
    success = rates.assign(method=rates["cell"].map(label)).rename(columns={"value": "success_rate"})
    _write(folder / "success.csv", success[["method", "success_rate", "low", "high", "thesis"]])
    table = results.differences
    differences = table.assign(method=table["cell"].map(label)).rename(columns={"value": "difference"})
    _write(
        folder / "differences.csv",
        differences[["method", "difference", "low", "high", "ratio", "p", "p_success"]],
    )
    for cell, translator in study.translators.items():
        picture = strip(typical_strip(translator), f"{cell}: {translator.typical('validation')}")
        write_atomically(folder / "strips" / f"{cell}.png", to_png(picture))
    if (idea := idea_strip(study)) is not None:
        write_atomically(folder / "idea.png", to_png(strip(idea)))


def _thin(curves: pd.DataFrame) -> pd.DataFrame:
    """Each cell's curve with at most ``_POINTS`` points and its last."""
    place = curves.groupby("cell", sort=False).cumcount()
    length = curves.groupby("cell", sort=False)["cell"].transform("size")
    return curves[(place % -(-length // _POINTS) == 0) | (place == length - 1)]


def _write(path: Path, table: pd.DataFrame) -> None:
    if len(table):
        write_atomically(path, table.to_csv(index=False, float_format=_rounded))


def _rounded(value: float) -> str:
    """Four significant digits, never in scientific notation for the sizes that occur here."""
    return f"{float(f'{value:.4g}'):.10g}"
