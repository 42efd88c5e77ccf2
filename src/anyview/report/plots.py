"""Tables and pictures for ``dvc plots``: wide tables, one column per cell, so that each is one plot."""

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
    trainings = {
        cell: training.curve.dropna(subset="validation_loss").set_index("iteration")["validation_loss"]
        for cell, training in study.trainings.items()
        if "validation_loss" in training.curve
    }
    _write_curves(folder / "translator_validation_loss.csv", trainings)
    distances = {
        cell: study.evaluations[cell].curve.groupby("iteration")["final_distance"].median()
        for cell in in_order(study.evaluations)
    }
    _write_curves(folder / "imitation_final_distance.csv", distances)
    weights = {
        cell: pd.Series(entry.feature_weights).rename_axis("frame")
        for cell, entry in study.translations.items()
    }
    _write_curves(folder / "feature_weights.csv", weights, points=None)
    _write(folder / "success.csv", _success(study))
    _write(folder / "final_distance_differences.csv", _differences(study))
    for cell, translation in study.translations.items():
        clip = typical_clip(translation, "validation")
        picture = strip(clip_strip(translation, clip), f"{cell}: {clip}")
        write_atomically(folder / "strips" / f"{cell}.png", to_png(picture))
    if (idea := idea_strip(study)) is not None:
        write_atomically(folder / "idea.png", to_png(strip(idea)))


def _write_curves(path: Path, curves: dict[str, pd.Series], points: int | None = _POINTS) -> None:
    """One column per cell over a shared index, thinned to about ``points`` rows."""
    if not curves:
        return
    table = pd.DataFrame(curves).sort_index()
    if points is not None:
        table = table.iloc[sorted({*range(0, len(table), -(-len(table) // points)), len(table) - 1})]
    _write(path, table.reset_index())


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
        write_atomically(path, table.to_csv(index=False, float_format="%.4g"))
