"""The metrics that Git tracks: few numbers under fixed keys, each estimate with its 95% bounds.

Written so that a review shows real changes alone: rounded to four digits, keys in a fixed order, no strings,
no timings. A mean ``m`` comes as ``m``, ``m_low`` and ``m_high``.
"""

import json
import math
from pathlib import Path
from typing import Any

import pandas as pd

from anyview.report.cells import in_order
from anyview.report.estimates import Estimate, Estimator, proportion
from anyview.report.inputs import LOSSES, RETURNS, Demonstrations, Evaluation, Study, Translation
from anyview.runtime.errors import AnyviewError
from anyview.runtime.outputs import write_atomically

Tree = dict[str, Any]


def data_metrics(study: Study) -> Tree:
    """``metrics/data.json``: {sim: {set: ...}, real: {...}}."""
    metrics: Tree = {"sim": {kind: _demonstrations(demos) for kind, demos in study.demonstrations.items()}}
    if study.clips is not None:
        split = study.splits.get("real", pd.DataFrame({"split": []}))["split"]
        counts = {name: int((split == name).sum()) for name in ("train", "validation", "extreme")}
        metrics["real"] = {
            "surrogate": int(study.surrogate),
            "recorded": study.clips.recorded,
            "refused": study.clips.refused,
            **counts,
        }
    return metrics


def translation_metrics(study: Study) -> Tree:
    """``metrics/translation.json``: {cell: {iterations, best_iteration, surrogate, validation, extreme}}."""
    estimator = Estimator(study.params.base.seed)
    metrics: Tree = {}
    for cell, translation in study.translations.items():
        training = study.trainings.get(cell)
        metrics[cell] = (
            {}
            if training is None
            else {
                "iterations": int(training.curve["iteration"].max()),
                "best_iteration": training.best_iteration,
            }
        )
        metrics[cell]["surrogate"] = int(study.is_real(cell) and study.surrogate)
        for split in ("validation", "extreme"):
            if len(translation.split(split)):
                metrics[cell][split] = _losses(estimator, f"{cell}/{split}", translation.split(split))
        if "extreme" in metrics[cell]:
            metrics[cell]["extreme"] |= _bounded("ratio", extreme_ratio(estimator, cell, translation))
    return metrics


def imitation_metrics(study: Study) -> Tree:
    """``metrics/imitation.json``: {cell: {runs, success_rate, final_distance_median, return_...}}."""
    estimator = Estimator(study.params.base.seed)
    return {
        cell: _evaluation(estimator, cell, study.evaluations[cell]) for cell in in_order(study.evaluations)
    }


def extreme_ratio(estimator: Estimator, cell: str, translation: Translation) -> Estimate:
    """Mean L_tr of the extreme clips over mean L_tr of the validation clips."""
    extreme, validation = (translation.split(name) for name in ("extreme", "validation"))
    return estimator.ratio_of_means(
        f"{cell}/ratio",
        extreme["translation"].to_numpy(float),
        validation["translation"].to_numpy(float),
        (extreme["pair"].to_numpy(), validation["pair"].to_numpy()) if "pair" in extreme else None,
    )


def ratio_change(estimator: Estimator, first: Translation, second: Translation) -> Estimate:
    """The extreme ratio of ``second`` minus that of ``first``, over the same clips."""
    both = first.clips.merge(second.clips, on=["clip", "split"], suffixes=("", "_second"), validate="1:1")
    samples, pairs = [], []
    for split in ("extreme", "validation"):
        rows = both[both["split"] == split]
        samples.append(rows[["translation", "translation_second"]].to_numpy(float))
        pairs.append(rows["pair" if "pair" in rows else "clip"].to_numpy())
    return estimator.change_of_ratio("ratio change", samples[0], samples[1], (pairs[0], pairs[1]))


def write_metrics(path: Path, metrics: Tree) -> None:
    """Write a tree of numbers as JSON; AnyviewError where a number is not finite."""
    write_atomically(path, json.dumps(_rounded(metrics, path.name), indent=2) + "\n")


def _demonstrations(demos: Demonstrations) -> Tree:
    count = len(demos.success)
    proposed = round(count / demos.acceptance)
    return {
        "demos": count,
        **_bounded("expert_success", proportion(int(demos.success.sum()), count)),
        **_bounded("acceptance", proportion(count, proposed)),
    }


def _losses(estimator: Estimator, name: str, clips: pd.DataFrame) -> Tree:
    pairs = clips["pair"].to_numpy() if "pair" in clips else None
    values: Tree = {}
    for loss in LOSSES:
        values |= _bounded(loss, estimator.mean(f"{name}/{loss}", clips[loss].to_numpy(float), pairs))
    return values


def _evaluation(estimator: Estimator, cell: str, evaluation: Evaluation) -> Tree:
    runs = evaluation.runs
    values: Tree = {"runs": len(runs)}
    values |= _bounded("success_rate", proportion(int(runs["success"].sum()), len(runs)))
    distances = runs["final_distance"].to_numpy(float)
    values |= _bounded("final_distance_median", estimator.median(f"{cell}/final_distance", distances))
    for name in RETURNS if evaluation.has_return_table else RETURNS[:1]:
        values |= _bounded(name, estimator.mean(f"{cell}/{name}", runs[name].to_numpy(float)))
    return values


def _bounded(name: str, estimate: Estimate) -> Tree:
    return {name: estimate.value, f"{name}_low": estimate.low, f"{name}_high": estimate.high}


def _rounded(tree: Tree, name: str) -> Tree:
    rounded: Tree = {}
    for key, value in tree.items():
        if isinstance(value, dict):
            rounded[key] = _rounded(value, f"{name}: {key}")
        elif isinstance(value, int):
            rounded[key] = value
        elif math.isfinite(value):
            rounded[key] = float(f"{value:.4g}")
        else:
            raise AnyviewError(
                f"{name}: {key} is not a finite number; is a loss or a distance in data/ broken?"
            )
    return rounded
