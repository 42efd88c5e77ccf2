"""Stage `train`: one context translator, into data/models/<cell>.

Usage: python stages/train.py CELL
"""

from anyview import paths
from anyview.config import load_params
from anyview.runtime.errors import choose, run_stage
from anyview.training.common.fit import fit
from anyview.training.translator import TranslatorObjective, open_learnt


def main(arguments: list[str]) -> None:
    """Train one cell; an interrupted training continues."""
    params = load_params()
    name = choose(arguments, params.translator_cells, "python stages/train.py CELL")
    cell = params.translator_cells[name]
    objective = TranslatorObjective(cell, params.training, params.base.seed, *open_learnt(cell))
    fit(name, objective, paths.model(name))


if __name__ == "__main__":
    run_stage(main)
