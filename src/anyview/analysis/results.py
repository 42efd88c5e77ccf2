"""Every result of a study as tidy tables, computed once: metrics, plots, figures and text read them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from anyview.analysis import comparisons, curves
from anyview.analysis.cells import ADAM, AUGMENTED, SIM, in_order
from anyview.analysis.diagnosis import Diagnosis, diagnose
from anyview.analysis.estimates import Estimate, Estimator, proportion, tidy, without_interval
from anyview.analysis.study import LOSSES, RETURNS, YARDSTICKS, AssessedTranslator, EvaluatedMethod, Study
from anyview.analysis.viewpoints import placed_by_angle

Rows = Iterator[tuple[str, str, Estimate]]


@dataclass(frozen=True)
class Results:
    """The tables. Methods are in the order of ``cells.in_order``.

    ``data``, ``translation`` and ``imitation`` hold the metrics that Git tracks, ``more`` what is only shown:
    all four as ``estimates.tidy`` makes them. The others are described by the function of the same name.
    """

    data: pd.DataFrame
    translation: pd.DataFrame
    imitation: pd.DataFrame
    more: pd.DataFrame
    losses: pd.DataFrame
    loss_points: pd.DataFrame
    optimizers: pd.DataFrame
    feature_weights: pd.DataFrame
    weight_ranges: pd.DataFrame
    differences: pd.DataFrame
    effects: pd.DataFrame
    factorial: pd.DataFrame
    learning: pd.DataFrame
    diagnoses: dict[str, Diagnosis]
    distances: pd.DataFrame
    viewpoints: pd.DataFrame
    """See ``viewpoints.placed_by_angle``."""
    real: tuple[str, ...]
    """Translators of real clips, or of their surrogate."""


def analyse(study: Study) -> Results:
    """Compute every table."""
    estimator = Estimator(study.params.base.seed)
    methods = {cell: study.methods[cell] for cell in in_order(study.methods)}
    losses = curves.losses(study.models)
    weights = curves.feature_weights(study.translators)
    return Results(
        data=tidy(_data(study)),
        translation=tidy(_translation(study, estimator)),
        imitation=outcomes(methods, estimator),
        more=tidy(_more(study, methods, estimator)),
        losses=losses,
        loss_points=curves.loss_points(losses),
        optimizers=curves.optimizers(losses),
        feature_weights=weights,
        weight_ranges=curves.weight_ranges(weights),
        differences=comparisons.differences(methods, estimator),
        effects=comparisons.effects(methods, estimator),
        factorial=comparisons.factorial(methods, estimator),
        learning=curves.learning(methods),
        diagnoses={cell: diagnose(method) for cell, method in methods.items()},
        distances=distances(methods),
        viewpoints=placed_by_angle(study, estimator),
        real=tuple(cell for cell in study.translators if study.is_real(cell)),
    )


def outcomes(methods: dict[str, EvaluatedMethod], estimator: Estimator) -> pd.DataFrame:
    """Success, final distance and return table of methods, as ``estimates.tidy`` makes it."""
    return tidy(_imitation(methods, estimator))


def distances(methods: dict[str, EvaluatedMethod]) -> pd.DataFrame:
    """Final distance in metres: a row per method, a column per run, NaN where a method lacks a run."""
    runs = {cell: method.runs.set_index("run")["final_distance"] for cell, method in methods.items()}
    return pd.DataFrame(runs).T


def extreme_ratio(estimator: Estimator, cell: str, translator: AssessedTranslator) -> Estimate:
    """Mean L_tr of the extreme clips over mean L_tr of the validation clips."""
    extreme, validation = (translator.split(name) for name in ("extreme", "validation"))
    return estimator.ratio_of_means(
        f"{cell}/ratio",
        extreme["translation"].to_numpy(float),
        validation["translation"].to_numpy(float),
        (extreme["pair"].to_numpy(), validation["pair"].to_numpy()) if "pair" in extreme else None,
    )


def ratio_change(estimator: Estimator, first: AssessedTranslator, second: AssessedTranslator) -> Estimate:
    """The extreme ratio of ``second`` minus that of ``first``, over the same clips."""
    both = first.clips.merge(second.clips, on=["clip", "split"], suffixes=("", "_second"), validate="1:1")
    samples, pairs = [], []
    for split in ("extreme", "validation"):
        rows = both[both["split"] == split]
        samples.append(rows[["translation", "translation_second"]].to_numpy(float))
        pairs.append(rows["pair" if "pair" in rows else "clip"].to_numpy())
    return estimator.change_of_ratio("ratio change", samples[0], samples[1], (pairs[0], pairs[1]))


def _data(study: Study) -> Rows:
    for name, demonstrations in study.simulated.items():
        cell, count = f"sim.{name}", len(demonstrations.success)
        yield cell, "demos", without_interval(count)
        yield cell, "expert_success", proportion(int(demonstrations.success.sum()), count)
        yield cell, "acceptance", proportion(count, round(count / demonstrations.acceptance))
    if study.real is not None:
        split = study.splits["real"]["split"].value_counts() if "real" in study.splits else {}
        counts = {
            "surrogate": study.surrogate,
            "recorded": study.real.recorded,
            "refused": study.real.refused,
            **{name: split.get(name, 0) for name in ("train", "validation", "extreme")},
        }
        for name, count in counts.items():
            yield "real", name, without_interval(count)


def _translation(study: Study, estimator: Estimator) -> Rows:
    for cell, translator in study.translators.items():
        if (model := study.models.get(cell)) is not None:
            yield cell, "iterations", without_interval(model.curve["iteration"].max())
            yield cell, "best_iteration", without_interval(model.best_iteration)
        yield cell, "surrogate", without_interval(study.is_real(cell) and study.surrogate)
        for split in ("validation", "extreme"):
            clips = translator.split(split)
            pairs = clips["pair"].to_numpy() if "pair" in clips else None
            for loss in LOSSES if len(clips) else ():
                values = clips[loss].to_numpy(float)
                yield cell, f"{split}.{loss}", estimator.mean(f"{cell}/{split}/{loss}", values, pairs)
            for name in YARDSTICKS:
                known = clips[clips[name].notna()]
                if len(known):
                    values = known[name].to_numpy(float)
                    pairs = known["pair"].to_numpy() if "pair" in known else None
                    yield cell, f"{split}.{name}", estimator.mean(f"{cell}/{split}/{name}", values, pairs)
        if len(translator.split("extreme")):
            yield cell, "extreme.ratio", extreme_ratio(estimator, cell, translator)


def _imitation(methods: dict[str, EvaluatedMethod], estimator: Estimator) -> Rows:
    for cell, method in methods.items():
        runs = method.runs
        yield cell, "runs", without_interval(len(runs))
        yield cell, "success_rate", proportion(int(runs["success"].sum()), len(runs))
        distances = runs["final_distance"].to_numpy(float)
        yield cell, "final_distance_median", estimator.median(f"{cell}/final_distance", distances)
        for name in RETURNS if method.has_return_table else RETURNS[:1]:
            yield cell, name, estimator.mean(f"{cell}/{name}", runs[name].to_numpy(float))


def _more(study: Study, methods: dict[str, EvaluatedMethod], estimator: Estimator) -> Rows:
    """``validation.clips``, ``.example_loss`` and ``.last_frame`` (L_tr there), ``extreme.ratio_change``.

    ``share_policy`` and ``share_arm_only``: what the policy, and the arm without the object, win of the
    expert's gain over standing still; absent where that gain is none.
    """
    translators = study.translators
    for cell in (ADAM, SIM):
        if cell in translators:
            clips = translators[cell].split("validation").set_index("clip")
            example = clips["loss"][translators[cell].typical("validation")]
            yield cell, "validation.clips", without_interval(len(clips))
            yield cell, "validation.example_loss", without_interval(example)
            yield cell, "validation.last_frame", without_interval(clips["last_frame"].mean())
    if all(cell in translators and len(translators[cell].split("extreme")) for cell in (ADAM, AUGMENTED)):
        change = ratio_change(estimator, translators[ADAM], translators[AUGMENTED])
        yield AUGMENTED, "extreme.ratio_change", change
    for cell, method in methods.items():
        if method.has_return_table:
            runs = method.runs
            gains = (runs["return_expert"] - runs["return_still"]).to_numpy(float)
            for name in ("arm_only", "policy") if np.mean(gains) > 0 else ():
                won = (runs[f"return_{name}"] - runs["return_still"]).to_numpy(float)
                yield cell, f"share_{name}", estimator.share(f"{cell}/return_{name}/share", won, gains)
