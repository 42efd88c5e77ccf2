"""Tables and pictures for ``dvc plots``, drawn by the templates in .dvc/plots.

Tables are long, a row per cell and point, so that a plot's declaration in dvc.yaml names no cell.
"""

from pathlib import Path

import pandas as pd

from anyview.report import thesis
from anyview.report.cells import in_order, label
from anyview.report.comparisons import compare_with_ours
from anyview.report.estimates import proportion
from anyview.report.exhibits_translation import clip_strip, typical_clip
from anyview.report.figures.style import to_png
from anyview.report.figures.translation import strip
from anyview.report.inputs import Study
from anyview.report.overview import idea_strip
from anyview.runtime.outputs import write_atomically

_POINTS = 100


def write_plots(folder: Path, study: Study) -> None:
    """Write every table and picture that ``study`` allows into ``folder``."""
    losses = {
        cell: training.curve[["iteration", "validation_loss"]] for cell, training in study.trainings.items()
    }
    distances = {cell: _quartiles(study.evaluations[cell].curve) for cell in in_order(study.evaluations)}
    weights = {
        cell: pd.Series(entry.feature_weights, name="weight").rename_axis("frame").reset_index()
        for cell, entry in study.translations.items()
    }
    _write(folder / "validation_loss.csv", _curves(losses))
    _write(folder / "final_distance.csv", _curves(distances))
    _write(folder / "feature_weights.csv", _curves(weights))
    _write(folder / "success.csv", _success(study))
    _write(folder / "differences.csv", _differences(study))
    for cell, translation in study.translations.items():
        clip = typical_clip(translation, "validation")
        picture = strip(clip_strip(translation, clip), f"{cell}: {clip}")
        write_atomically(folder / "strips" / f"{cell}.png", to_png(picture))
    if (idea := idea_strip(study)) is not None:
        write_atomically(folder / "idea.png", to_png(strip(idea)))


def _quartiles(curve: pd.DataFrame) -> pd.DataFrame:
    """Columns ``iteration``, ``final_distance`` (median over runs), ``low`` and ``high`` (quartiles)."""
    quartiles = curve.groupby("iteration")["final_distance"].quantile([0.5, 0.25, 0.75]).unstack()
    return quartiles.set_axis(["final_distance", "low", "high"], axis=1).reset_index()


def _curves(curves: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """``cell`` and the curves' own columns; each curve thinned to at most ``_POINTS`` points and its last."""
    parts = []
    for cell, curve in curves.items():
        kept = sorted({*range(0, len(curve), -(-len(curve) // _POINTS)), len(curve) - 1})
        thin = curve.iloc[kept].copy()
        thin.insert(0, "cell", cell)
        parts.append(thin)
    return pd.concat(parts) if parts else pd.DataFrame()


def _success(study: Study) -> pd.DataFrame:
    rows = []
    for cell in in_order(study.evaluations):
        runs = study.evaluations[cell].runs
        rate = proportion(int(runs["success"].sum()), len(runs))
        stated = thesis.SUCCESSES.get(cell)
        rows.append(
            {
                "method": label(cell),
                "success_rate": rate.value,
                "low": rate.low,
                "high": rate.high,
                "thesis": None if stated is None else stated / thesis.RUNS,
            }
        )
    return pd.DataFrame(rows)


def _differences(study: Study) -> pd.DataFrame:
    rows = [
        {
            "method": label(entry.cell),
            "difference": entry.difference.value,
            "low": entry.difference.low,
            "high": entry.difference.high,
            "mcnemar_p": entry.p,
        }
        for entry in compare_with_ours(study.evaluations, study.params.base.seed)
    ]
    return pd.DataFrame(rows)


def _write(path: Path, table: pd.DataFrame) -> None:
    if len(table):
        write_atomically(path, table.to_csv(index=False, float_format=_rounded))


def _rounded(value: float) -> str:
    """Four significant digits, never in scientific notation for the sizes that occur here."""
    return f"{float(f'{value:.4g}'):.10g}"
