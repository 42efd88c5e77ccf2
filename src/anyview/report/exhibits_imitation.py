"""Figures 19 and 20 as exhibits, and what explains them: differences, the 2x2, returns, learning, reasons."""

from collections.abc import Iterator

import numpy as np
import pandas as pd

from anyview.report import thesis
from anyview.report.cells import FACTORIAL, OURS, ablated, compared, in_order, label
from anyview.report.comparisons import Comparison, compare_with_ours, factorial_effects
from anyview.report.content import Exhibit, Reel, Section, Table
from anyview.report.estimates import Estimate, Estimator, proportion
from anyview.report.figures import imitation as figures
from anyview.report.figures.style import to_svg
from anyview.report.findings import anatomy, anatomy_row, claims, effect_sentence, order
from anyview.report.inputs import Study
from anyview.report.metrics import Tree
from anyview.report.pictures import make_film
from anyview.report.words import (
    ABSENT,
    centimetres,
    centimetres_spread,
    plural,
    probability,
    rate_spread,
    spread,
)

_REEL_RUNS = 6


def section(study: Study, metrics: Tree) -> Section:
    """The chapter on the policies."""
    comparisons = compare_with_ours(study.evaluations, study.params.base.seed)
    exhibits = (
        *_success(study, 19, compared(study.evaluations), "against other methods"),
        *_success(study, 20, ablated(study.evaluations), "without a loss"),
        *_differences(comparisons),
        *_factorial(study),
        *_returns(study, metrics),
        *_learning(study),
        *_reasons(study),
        *_rollouts(study),
        *_table(metrics),
        *_every_run(study),
    )
    text = (
        "A run is one new context and one new policy. Every method is evaluated in the same "
        f"{plural(study.params.imitation.runs, 'context')}, without exploration noise, so that methods are "
        "compared in pairs. Success: the object’s centre ends within 2 cm of the goal’s.",
        "With 15 runs, 12 successes against 7 are not significant (exact McNemar p ≥ 0.06): most gaps of "
        "the thesis are not. An order is put into words here only where the 95% interval of the paired "
        "difference of final distance excludes zero over at least 6 runs; these intervals are not "
        "corrected for their number.",
    )
    return Section("imitation", "Imitation", text, exhibits)


def _success(study: Study, figure: int, cells: list[str], what: str) -> Iterator[Exhibit]:
    if not cells or (figure == 20 and cells == [OURS]):
        return
    bars, rows = [], []
    for cell in cells:
        runs = study.evaluations[cell].runs
        successes = int(runs["success"].sum())
        rate = proportion(successes, len(runs))
        stated = thesis.SUCCESSES.get(cell)
        bars.append(figures.Bar(cell, rate, None if stated is None else stated / thesis.RUNS))
        rows.append((label(cell), _thesis_rate(stated), rate_spread(*_values(rate))))
    yield Exhibit(
        f"figure-{figure}",
        f"Figure {figure}. Success {what}",
        ("Intervals are Wilson’s, the thesis’s too: it gives none, they follow from its 15 runs.",),
        to_svg(figures.success(bars)),
        comparison=Table(("Method", "Thesis", "Here"), tuple(rows)),
    )


def _thesis_rate(successes: int | None) -> str:
    return ABSENT if successes is None else rate_spread(*_values(proportion(successes, thesis.RUNS)))


def _differences(comparisons: list[Comparison]) -> Iterator[Exhibit]:
    if not comparisons:
        return
    rows = tuple(
        (
            label(entry.cell),
            centimetres_spread(*_values(entry.difference)),
            order(entry),
            f"{entry.only_ours}\u00a0:\u00a0{entry.only_other}",
            probability(entry.p),
        )
        for entry in comparisons
    )
    headings = ("Method", "Difference", "Order", "Succeeds alone, ours : it", "McNemar p")
    yield Exhibit(
        "differences",
        "Final distance against ours, context by context",
        (
            "Mean over the runs of the method’s final distance minus ours, with its paired bootstrap "
            "interval. It says more than success, which throws away by how much a run misses.",
            *claims(comparisons),
        ),
        to_svg(figures.differences(comparisons)),
        table=Table(headings, rows),
    )


def _factorial(study: Study) -> Iterator[Exhibit]:
    effects = factorial_effects(study.evaluations, study.params.base.seed)
    if not effects:
        return
    estimator = Estimator(study.params.base.seed)
    bars = {}
    for contexts, row in zip(("narrow", "diverse"), FACTORIAL, strict=True):
        for learner, cell in zip(("TRPO", "DDPG"), row, strict=True):
            distances = study.evaluations[cell].runs["final_distance"].to_numpy(float)
            bars[contexts, learner] = figures.Bar(cell, estimator.mean(f"{cell}/mean_distance", distances))
    yield Exhibit(
        "factorial",
        "What the thesis leaves open: diverse data, or DDPG?",
        (
            "The thesis compares its own method (DDPG, diverse contexts) with Liu’s (TRPO, narrow ones) "
            "and cannot tell which of the two changes matters. With all four combinations on the same "
            "runs, the change of the final distance is:",
            *(effect_sentence(effect) for effect in effects),
        ),
        to_svg(figures.factorial(bars)),
    )


def _returns(study: Study, metrics: Tree) -> Iterator[Exhibit]:
    cells = [cell for cell in in_order(study.evaluations) if study.evaluations[cell].has_return_table]
    if not cells:
        return
    names = ("return_still", "return_arm_only", "return_policy", "return_expert")
    rows = tuple((label(cell), *(spread(*_bounds(metrics[cell], name)) for name in names)) for cell in cells)
    shares = {cell: both for cell in cells if (both := _shares(study, cell)) is not None}
    yield Exhibit(
        "returns",
        "What each reward pays for",
        (
            "Returns under each method’s own reward, mean over the runs. The gap between the arm alone "
            "and the expert’s motion is what the object carries: a reward without that gap cannot teach "
            "pushing, whatever learns from it. It is known before any policy is trained. A method under "
            "whose reward the expert earns no more than standing still is in the table alone.",
        ),
        to_svg(figures.returns(shares)) if shares else "",
        table=Table(("Method", "Standing still", "Arm without object", "Policy", "Expert’s motion"), rows),
    )


def _shares(study: Study, cell: str) -> tuple[Estimate, Estimate] | None:
    """What the arm without the object, and the policy, win of the expert's gain over standing still."""
    runs, estimator = study.evaluations[cell].runs, Estimator(study.params.base.seed)
    gains = (runs["return_expert"] - runs["return_still"]).to_numpy(float)
    if gains.mean() <= 0:
        return None
    arm, policy = (
        estimator.share(f"{cell}/{name}/share", (runs[name] - runs["return_still"]).to_numpy(float), gains)
        for name in ("return_arm_only", "return_policy")
    )
    return arm, policy


def _learning(study: Study) -> Iterator[Exhibit]:
    curves = {cell: study.evaluations[cell].curve for cell in in_order(study.evaluations)}
    if not curves:
        return
    yield Exhibit(
        "learning",
        "Learning curves",
        (
            "Final distance of the policy so far, acting without noise: median and interquartile band "
            "over the runs. Dashed grey: ours.",
        ),
        to_svg(figures.learning(curves, OURS, "final_distance", "cm", 100)),
    )


def _reasons(study: Study) -> Iterator[Exhibit]:
    rows = tuple(anatomy_row(cell, anatomy(study.evaluations[cell])) for cell in in_order(study.evaluations))
    if rows:
        headings = ("Method", "Success", "Object carries", "Policy wins", "Return and nearness", "So")
        yield Exhibit(
            "reasons",
            "Why each method does what it does",
            (
                "Read off its own measurements. Of what the expert’s motion earns above standing still: "
                "how much needs the object, and how much the trained policy wins. Return and nearness: "
                "rank correlation over training of a run’s return with its nearness to the goal; 1 is a "
                "reward that leads there. The last column is the first of a fixed list of explanations "
                "that these numbers support.",
            ),
            table=Table(headings, rows),
        )


def _rollouts(study: Study) -> Iterator[Exhibit]:
    cells = [cell for cell in in_order(study.evaluations) if study.evaluations[cell].rollouts]
    if not cells:
        return
    runs = sorted({run for cell in cells for run in study.evaluations[cell].rollouts})[:_REEL_RUNS]
    reels = []
    for run in runs:
        films = []
        for cell in cells:
            evaluation = study.evaluations[cell]
            if run in evaluation.rollouts:
                distance = evaluation.runs.set_index("run")["final_distance"][run]
                films.append(make_film(evaluation.rollout(run), f"{label(cell)}: {centimetres(distance)}"))
        reels.append(Reel(f"Run {run}", tuple(films)))
    yield Exhibit(
        "rollouts",
        "The trained policies, playing",
        (
            "Left the agent, right the demonstration that it imitates: translated into its view, for the "
            "Oracle as it truly looks there, for the TCN embedding, TPIL and GAIL as filmed elsewhere. The "
            f"first {plural(len(runs), 'run')}, not picked by outcome; each run is one context, the same for "
            "every method. Below each: how far the object ends from the goal.",
        ),
        reels=tuple(reels),
    )


def _table(metrics: Tree) -> Iterator[Exhibit]:
    rows = tuple(
        (
            label(cell),
            str(values["runs"]),
            rate_spread(*_bounds(values, "success_rate")),
            centimetres_spread(*_bounds(values, "final_distance_median")),
            spread(*_bounds(values, "return_policy")),
        )
        for cell, values in metrics.items()
    )
    if rows:
        yield Exhibit(
            "methods",
            "Every method",
            ("Returns are each under the method’s own reward: they do not compare between rewards.",),
            table=Table(("Method", "Runs", "Success", "Median final distance", "Return"), rows),
        )


def _every_run(study: Study) -> Iterator[Exhibit]:
    cells = in_order(study.evaluations)
    if not cells:
        return
    distances = pd.DataFrame(
        {cell: study.evaluations[cell].runs.set_index("run")["final_distance"] for cell in cells}
    )
    rows = tuple(
        (label(cell), *("" if np.isnan(metres) else f"{100 * metres:.1f}" for metres in distances[cell]))
        for cell in cells
    )
    yield Exhibit(
        "runs",
        "Every run",
        ("Final distance in centimetres of each run: up to 2.0 is a success. One column is one context.",),
        table=Table(("Method", *(str(run) for run in distances.index)), rows),
    )


def _bounds(values: Tree, name: str) -> tuple[float, float, float]:
    return values[name], values[f"{name}_low"], values[f"{name}_high"]


def _values(estimate: Estimate) -> tuple[float, float, float]:
    return estimate.value, estimate.low, estimate.high
