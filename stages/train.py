"""Stage `train`: one context translator, into data/models/<cell>.

Usage: python stages/train.py CELL
"""

from anyview import paths
from anyview.config import load_params
from anyview.runtime.errors import choose, run_stage
from anyview.training.trainer import Recipe
from anyview.training.training import train_translator


def main(arguments: list[str]) -> None:
    """Train one cell; an interrupted training continues."""
    params = load_params()
    name = choose(arguments, params.translators, "python stages/train.py CELL")
    recipe = Recipe(name, params.translators[name], params.training, params.base.seed)
    train_translator(recipe, paths.model(name))


if __name__ == "__main__":
    run_stage(main)
