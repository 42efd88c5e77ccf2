"""Stage `embed`: one time-contrastive embedding, into data/models/<cell>.

Usage: python stages/embed.py CELL
"""

from anyview import paths
from anyview.config import load_params
from anyview.runtime.errors import choose, run_stage
from anyview.training.common.fit import fit
from anyview.training.embedding import EmbeddingObjective
from anyview.video.datasets import open_dataset


def main(arguments: list[str]) -> None:
    """Train one cell; an interrupted training continues."""
    params = load_params()
    name = choose(arguments, params.embeddings, "python stages/embed.py CELL")
    cell = params.embeddings[name]
    objective = EmbeddingObjective(cell, params.training, params.base.seed, open_dataset(cell.dataset))
    fit(name, objective, paths.model(name))


if __name__ == "__main__":
    run_stage(main)
