"""Sentences drawn from measurements. An order is claimed only where a paired interval excludes zero."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy import stats

from anyview.report.cells import label
from anyview.report.comparisons import ENOUGH_RUNS, Comparison, Effect
from anyview.report.inputs import Evaluation
from anyview.report.words import ABSENT, centimetres, centimetres_spread, listed, percent

BLIND = 0.2
"""Rank correlation of return with nearness below which a reward counts as blind to the task."""
UNSEEN = 0.15
"""Share of the expert's return carried by the object below which a reward hardly sees it."""
SHORT = 0.9
"""Share of the expert's return below which the learner, and not the reward, is what stops a method."""
GOOD = 0.8
"""Success rate from which a method needs no excuse: the thesis's own for its method."""


@dataclass(frozen=True)
class Anatomy:
    """What the measurements say about a method. None where there is nothing to measure.

    ``worth`` is the return of the expert's own motion above that of standing still. Shares of it are
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


def anatomy(evaluation: Evaluation) -> Anatomy:
    """Measure ``evaluation``."""
    worth = carried = reached = None
    if evaluation.has_return_table:
        runs = evaluation.runs
        gains = runs["return_expert"] - runs["return_still"]
        worth = float(gains.median())
        if worth > 0:
            carried = float((runs["return_expert"] - runs["return_arm_only"]).median() / worth)
            reached = float((runs["return_policy"] - runs["return_still"]).median() / worth)
    success = float(evaluation.runs["success"].mean())
    distance = float(evaluation.runs["final_distance"].median())
    curve = evaluation.curve
    return Anatomy(success, distance, worth, carried, reached, _guidance(curve), _accuracies(curve))


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


def why(measured: Anatomy) -> str:
    """A sentence on why a method does what it does, the first that its measurements support."""
    carried, reached, guidance = measured.carried, measured.reached, measured.guidance
    accuracies = [f"{name} {percent(value)}" for name, value in measured.accuracies.items()]
    judged = f" (its discriminator tells right: {listed(accuracies)})" if accuracies else ""
    if measured.worth is not None and measured.worth <= 0:
        return (
            "The expert’s own motion earns no more than standing still: this reward leads away from the task."
        )
    if carried is not None and carried < UNSEEN:
        return (
            f"Moving the arm without the object already earns {percent(1 - carried)} of what the expert "
            "earns: the reward hardly sees the object."
        )
    if measured.success >= GOOD:
        return f"It succeeds: the reward tells progress, and the learner follows it{judged}."
    blind = guidance is not None and guidance < BLIND
    if reached is None:
        if guidance is None:
            return ABSENT
        if blind:
            return (
                f"Over training, earning more did not go with ending nearer{judged}: following this reward "
                "is not doing the task."
            )
        return f"Earning more goes with ending nearer{judged}, but not near enough."
    if reached < SHORT:
        return (
            f"The policy wins only {percent(reached)} of what the expert’s motion would earn: the reward has "
            "more to give, and the learner stops short of it."
        )
    if blind:
        return (
            f"The policy wins {percent(reached)} of what the expert’s motion earns, but earning more did not "
            "go with ending nearer: the reward is matched without doing the task."
        )
    if reached >= 1:
        return (
            "The policy earns more than the expert’s own motion and still misses: the reward’s optimum is "
            "not the goal."
        )
    return (
        f"The policy wins {percent(reached)} of what the expert’s motion earns and ends "
        f"{centimetres(measured.distance)} from the goal: the reward takes no more than "
        f"{percent(1 - reached)} for that."
    )


def anatomy_row(cell: str, measured: Anatomy) -> tuple[str, ...]:
    """Method, success, carried, reached, guidance, why: as text for a table."""
    carried, reached = (
        ABSENT if share is None else percent(share) for share in (measured.carried, measured.reached)
    )
    guidance = ABSENT if measured.guidance is None else f"{measured.guidance:.2f}".replace("-", "−")
    return (label(cell), percent(measured.success), carried, reached, guidance, why(measured))


def order(comparison: Comparison) -> str:
    """The order that may be claimed: nearer to the goal than ours, farther, or open."""
    if not comparison.ordered:
        return "open"
    return "farther" if comparison.difference.value > 0 else "nearer"


def claims(comparisons: list[Comparison]) -> list[str]:
    """The orders that the data support, a sentence for each side, and which pairs stay open."""
    farther = [_named(entry) for entry in comparisons if entry.ordered and entry.difference.value > 0]
    nearer = [_named(entry) for entry in comparisons if entry.ordered and entry.difference.value < 0]
    undecided = [label(entry.cell) for entry in comparisons if not entry.ordered]
    sentences = []
    if farther:
        sentences.append(f"Farther from the goal than ours: {'; '.join(farther)}.")
    if nearer:
        sentences.append(f"Nearer to the goal than ours: {'; '.join(nearer)}.")
    if undecided:
        sentences.append(f"No order can be claimed between ours and: {'; '.join(undecided)}.")
    return sentences


def effect_sentence(effect: Effect) -> str:
    """An effect of the 2x2 in words."""
    size = effect.size
    stated = centimetres_spread(size.value, size.low, size.high)
    if not effect.present:
        reason = "the interval holds zero" if effect.runs >= ENOUGH_RUNS else "the runs are too few"
        return f"{effect.name}: {stated}; {reason}, so no effect is claimed."
    word = "nearer to the goal" if size.value < 0 else "farther from the goal"
    return f"{effect.name}: {stated}; the object ends {word}."


def _named(comparison: Comparison) -> str:
    size = comparison.difference
    low, high = sorted((abs(size.low), abs(size.high)))
    return f"{label(comparison.cell)} by {centimetres_spread(abs(size.value), low, high)}"
