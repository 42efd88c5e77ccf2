"""Why a method does what it does, read off its own measurements."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy import stats

from anyview.analysis.study import EvaluatedMethod

BLIND = 0.2
"""Rank correlation of return with nearness below which a reward counts as blind to the task."""
UNSEEN = 0.15
"""Fraction of the expert's return carried by the object below which a reward hardly sees it."""
SHORT = 0.9
"""Fraction of the expert's return below which the learner, and not the reward, is what stops a method."""
GOOD = 0.8
"""Success rate from which a method needs no excuse: the thesis's own for its method."""


@dataclass(frozen=True)
class Diagnosis:
    """What the measurements say about a method. None where there is nothing to measure.

    ``worth`` is the return of the expert's own motion above that of standing still. Fractions of it are
    ``carried``, which needs the object and not the arm alone, and ``reached``, which the policy wins.
    ``distance`` is the median final one in metres.
    ``guidance`` is the rank correlation over training of a run's return with its nearness to the goal. All
    are medians over runs. ``accuracies`` of a discriminator by set of frames, mean over the last tenth.
    """

    success: float
    distance: float
    worth: float | None
    carried: float | None
    reached: float | None
    guidance: float | None
    accuracies: dict[str, float]

    @property
    def reason(self) -> str:
        """The first of a fixed list of explanations that the measurements support; the template words it."""
        blind = self.guidance is not None and self.guidance < BLIND
        if self.worth is not None and self.worth <= 0:
            return "leads away"
        if self.carried is not None and self.carried < UNSEEN:
            return "object unseen"
        if self.success >= GOOD:
            return "succeeds"
        if self.reached is None:
            return "unknown" if self.guidance is None else "misguides" if blind else "not near enough"
        if self.reached < SHORT:
            return "learner stops short"
        if blind:
            return "matched without the task"
        return "optimum elsewhere" if self.reached >= 1 else "ends near"


def diagnose(method: EvaluatedMethod) -> Diagnosis:
    """Measure ``method``."""
    worth = carried = reached = None
    runs, curve = method.runs, method.curve
    if method.has_return_table:
        worth = float((runs["return_expert"] - runs["return_still"]).median())
        if worth > 0:
            carried = float((runs["return_expert"] - runs["return_arm_only"]).median() / worth)
            reached = float((runs["return_policy"] - runs["return_still"]).median() / worth)
    success, distance = float(runs["success"].mean()), float(runs["final_distance"].median())
    return Diagnosis(success, distance, worth, carried, reached, _guidance(curve), _accuracies(curve))


def _guidance(curve: pd.DataFrame) -> float | None:
    correlations = []
    for _, run in curve.groupby("run"):
        if len(run) >= 5 and run["return"].nunique() > 1 and run["final_distance"].nunique() > 1:
            correlations.append(stats.spearmanr(run["return"], -run["final_distance"]).statistic)
    return float(np.median(correlations)) if correlations else None


def _accuracies(curve: pd.DataFrame) -> dict[str, float]:
    late = curve[curve["iteration"] >= curve["iteration"].quantile(0.9)]
    return {
        column.removesuffix("_accuracy"): float(late[column].mean())
        for column in curve.columns
        if column.endswith("_accuracy") and late[column].notna().any()
    }
