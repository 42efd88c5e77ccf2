"""Stage `train` of what goes beyond the thesis: one context translator, into data/models/<cell>.

Usage: python train.py CELL
"""

from dataclasses import replace

from anyview import paths
from anyview.config import load_params
from anyview.runtime.errors import choose, run_stage
from anyview.training.common.fit import fit
from anyview.training.simulated_marks import simulated_marks
from anyview.training.translator import TranslatorObjective, open_learnt


def main(arguments: list[str]) -> None:
    """Train one cell; an interrupted training continues."""
    params = load_params()
    name = choose(arguments, params.beyond.translators, "python train.py CELL")
    cell = params.beyond.translators[name]
    dataset, pretraining = open_learnt(cell)
    if cell.other_experts and cell.weights.places:
        marks = simulated_marks(dataset)
        dataset = replace(dataset, marks=marks)
        pretraining = pretraining and replace(pretraining, marks=marks)
    fit(
        name,
        TranslatorObjective(cell, params.training, params.base.seed, dataset, pretraining),
        paths.model(name),
    )


if __name__ == "__main__":
    run_stage(main)
