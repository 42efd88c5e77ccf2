"""Stage `train`: one context translator, into data/models/<cell>.

Usage: python stages/train.py CELL
"""

from anyview import paths
from anyview.config import load_params
from anyview.runtime.errors import choose, run_stage
from anyview.training.common.fit import fit
from anyview.training.translator import TranslatorObjective
from anyview.video.datasets import open_dataset


def main(arguments: list[str]) -> None:
    """Train one cell; an interrupted training continues."""
    params = load_params()
    name = choose(arguments, params.translator_cells, "python stages/train.py CELL")
    cell = params.translator_cells[name]
    pretraining = open_dataset(cell.pretraining.dataset) if cell.pretraining.iterations else None
    objective = TranslatorObjective(
        cell, params.training, params.base.seed, open_dataset(cell.dataset), pretraining
    )
    fit(name, objective, paths.model(name))


if __name__ == "__main__":
    run_stage(main)
