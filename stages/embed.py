"""Stage `embed`: one time-contrastive embedding, into data/models/<cell>.

Usage: python stages/embed.py CELL
"""

from anyview import paths
from anyview.config import load_params
from anyview.embedding.embedding import train_embedding
from anyview.runtime.errors import choose, run_stage


def main(arguments: list[str]) -> None:
    """Train one cell; an interrupted training continues."""
    params = load_params()
    name = choose(arguments, params.embeddings, "python stages/embed.py CELL")
    train_embedding(name, params.embeddings[name], params.training, params.base.seed, paths.model(name))


if __name__ == "__main__":
    run_stage(main)
