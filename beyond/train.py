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
from anyview.video.datasets import Dataset


def main(arguments: list[str]) -> None:
    """Train one cell; an interrupted training continues."""
    params = load_params()
    name = choose(arguments, params.beyond.translators, "python train.py CELL")
    cell = params.beyond.translators[name]
    dataset, pretraining = open_learnt(cell)
    if cell.weights.places:
        dataset, pretraining = _marked(dataset), pretraining and _marked(pretraining)
    fit(
        name,
        TranslatorObjective(cell, params.training, params.base.seed, dataset, pretraining),
        paths.model(name),
    )


def _marked(dataset: Dataset) -> Dataset:
    """With the marks of its own clips; those of other experts' clips it has where their set does."""
    return replace(dataset, marks=simulated_marks(dataset))


if __name__ == "__main__":
    run_stage(main)
