"""Values over iterations and frames as tidy tables, beside the points that the thesis states."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from anyview.analysis import thesis
from anyview.analysis.cells import ADADELTA, ADAM
from anyview.analysis.study import AssessedTranslator, EvaluatedMethod, TrainedModel

PUBLISHED = {ADAM: thesis.ADAM, ADADELTA: thesis.ADADELTA}
"""The thesis's trainings, by the cell that repeats them."""


def losses(models: Mapping[str, TrainedModel]) -> pd.DataFrame:
    """``cell, iteration, loss, validation_loss``: a row per validation."""
    curves = {cell: model.curve for cell, model in models.items()}
    return _stacked(curves, ["iteration", "loss", "validation_loss"])


def loss_points(losses: pd.DataFrame) -> pd.DataFrame:
    """What the thesis states of its losses over training, and the same of ours.

    ``cell, loss, point, thesis, thesis_iteration, value, iteration``; NaN where the thesis is silent.
    """
    rows = []
    for cell, published in PUBLISHED.items():
        curve = losses[losses["cell"] == cell].set_index("iteration")
        for column, stated in (("loss", published.total), ("validation_loss", published.validation)):
            ours = curve[column]
            if ours.empty:
                continue
            first, by_500 = ours.index[0], ours[ours.index <= max(500, ours.index[0])].index[-1]
            start = np.nan if stated.start is None else stated.start
            rows += [
                (cell, column, "first", start, np.nan, ours.iloc[0], first),
                (cell, column, "by iteration 500", stated.at_500, np.nan, ours[by_500], by_500),
                (
                    cell,
                    column,
                    "minimum",
                    stated.minimum,
                    stated.minimum_iteration,
                    ours.min(),
                    ours.idxmin(),
                ),
            ]
    names = ["cell", "loss", "point", "thesis", "thesis_iteration", "value", "iteration"]
    return pd.DataFrame(rows, columns=names)


def optimizers(losses: pd.DataFrame) -> pd.DataFrame:
    """Validation loss with Adam and AdaDelta at the last validation that both have reached; else no row.

    ``iteration, adam, adadelta``.
    """
    columns = losses.pivot(index="iteration", columns="cell", values="validation_loss")
    both = columns.reindex(columns=[ADAM, ADADELTA]).dropna().set_axis(["adam", "adadelta"], axis=1)
    return both.tail(1).reset_index()


def learning(methods: Mapping[str, EvaluatedMethod]) -> pd.DataFrame:
    """Final distance in metres of the policy so far: ``cell, iteration, final_distance, low, high``.

    The median over the runs, and the quartiles.
    """
    curves = {}
    for cell, method in methods.items():
        quartiles = method.curve.groupby("iteration")["final_distance"].quantile([0.5, 0.25, 0.75]).unstack()
        curves[cell] = quartiles.set_axis(["final_distance", "low", "high"], axis=1).reset_index()
    return _stacked(curves, ["iteration", "final_distance", "low", "high"])


def feature_weights(translators: Mapping[str, AssessedTranslator]) -> pd.DataFrame:
    """``cell, frame, weight``: how much each frame of the expert's clip matters to a translator."""
    curves = {
        cell: pd.DataFrame({"frame": range(len(entry.feature_weights)), "weight": entry.feature_weights})
        for cell, entry in translators.items()
    }
    return _stacked(curves, ["frame", "weight"])


def weight_ranges(weights: pd.DataFrame) -> pd.DataFrame:
    """Mean weight over the ranges of frames of figure 15: ``first, last, thesis, scaled, value``.

    ``scaled`` is the thesis's, brought to a sum of 1; ``value`` is NaN where the clips have another length.
    """
    ours = weights.loc[weights["cell"] == ADAM, "weight"].to_numpy()
    scale = thesis.feature_weight_scale()
    rows = [
        (
            first,
            last,
            stated,
            stated * scale,
            ours[first : last + 1].mean() if len(ours) == thesis.FRAMES else np.nan,
        )
        for first, last, stated in thesis.FEATURE_WEIGHTS
    ]
    return pd.DataFrame(rows, columns=["first", "last", "thesis", "scaled", "value"])


def _stacked(curves: Mapping[str, pd.DataFrame], columns: list[str]) -> pd.DataFrame:
    """``cell`` and ``columns``, one curve below another."""
    if not curves:
        return pd.DataFrame(columns=["cell", *columns])
    stacked = pd.concat({cell: curve[columns] for cell, curve in curves.items()}, names=["cell"])
    return stacked.reset_index("cell").reset_index(drop=True)
