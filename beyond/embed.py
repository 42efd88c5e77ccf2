"""Stage `embed` of what goes beyond the thesis: XIRL's embedding, into data/models/<cell>.

Usage: python embed.py CELL
"""

from anyview import paths
from anyview.config import load_params
from anyview.runtime.errors import choose, run_stage
from anyview.training.common.fit import fit
from anyview.training.cycles import CycleObjective
from anyview.video.datasets import open_dataset


def main(arguments: list[str]) -> None:
    """Train one cell; an interrupted training continues."""
    params = load_params()
    name = choose(arguments, params.beyond.embeddings, "python embed.py CELL")
    cell = params.beyond.embeddings[name]
    dataset = open_dataset(cell.dataset, cell.other_experts)
    fit(name, CycleObjective(cell, params.training, params.base.seed, dataset), paths.model(name))


if __name__ == "__main__":
    run_stage(main)
