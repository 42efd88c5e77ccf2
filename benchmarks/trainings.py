"""How much of a result is one training's luck? `ours` by several trainings of its translator.

    python benchmarks/trainings.py [SEED ...]     (default: 1 2 3)

Translators differ in first weights and batches, by their seeds. The agents' contexts are of the stream
"tuning", never the evaluation's; they are the same for each translator. All else is params.yaml's. Needs
`dvc repro split@diverse`. Models and policies are left in benchmarks/out/trainings.
"""

import os
import sys
from pathlib import Path

import pandas as pd

from anyview import paths
from anyview.analysis.statistics import wilson_interval
from anyview.config import DemonstrationCell, load_params
from anyview.config.imitation import Shown
from anyview.evaluation.methods import Method
from anyview.evaluation.stage import evaluate_method
from anyview.learners import ddpg
from anyview.rewards.cells import make_reward
from anyview.training.common.fit import fit
from anyview.training.translator import TranslatorObjective
from anyview.video.datasets import open_dataset

ROOT = Path(__file__).parents[1]
CELL = "ours"


class TuningCell(DemonstrationCell):
    """A cell whose contexts are not the evaluation's."""

    @property
    def shown(self) -> Shown:
        return Shown(contexts="tuning")


def main(seeds: list[int]) -> None:
    params = load_params(ROOT / "params.yaml")
    data = ROOT / "benchmarks/out/trainings/data"
    data.mkdir(parents=True, exist_ok=True)
    for name in ("clips", "splits"):
        if not (data / name).exists():
            (data / name).symlink_to(ROOT / "data" / name)
    os.chdir(data.parent)
    ours = params.imitation.cells[CELL]
    translator = params.translators[ours.model]
    dataset = open_dataset(translator.dataset)
    tables = []
    for seed in seeds:
        model = paths.replicate(ours.model, seed)
        fit(model, TranslatorObjective(translator, params.training, seed, dataset), paths.model(model))
        name = paths.replicate(ours.model, seed, CELL)
        cell = TuningCell.model_validate(ours.model_dump() | {"model": model})
        imitation = params.imitation.model_copy(update={"cells": {name: cell}})
        changed = params.model_copy(update={"imitation": imitation})
        evaluate_method(name, changed, Method(ddpg.make_learner, make_reward), [paths.model(model)])
        tables.append(pd.read_csv(paths.policies(name) / "runs.csv"))
        report(f"seed {seed}", tables[-1])
    report("all", pd.concat(tables))


def report(name: str, runs: pd.DataFrame) -> None:
    """Print how many of the ``runs`` succeed, and their median distance."""
    succeeded = int(runs["success"].sum())
    low, high = wilson_interval(succeeded, len(runs))
    rate = f"{succeeded} of {len(runs)} succeed, {succeeded / len(runs):.0%} [{low:.0%}, {high:.0%}]"
    print(f"{name:8} {rate}, median {100 * runs['final_distance'].median():.1f} cm", flush=True)


if __name__ == "__main__":
    main([int(seed) for seed in sys.argv[1:]] or [1, 2, 3])
