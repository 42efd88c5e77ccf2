"""Stage `headline-embed`: one of several embeddings at full budget, into data/models/headline-<...>.

Usage, in evidence/: python headline/embed.py EMBEDDING SEED
"""

from anyview import paths
from anyview.config import load_params
from anyview.runtime.errors import choose_each, run_stage
from anyview.training.common.fit import fit
from anyview.training.embedding import EmbeddingObjective
from anyview.video.datasets import open_dataset


def main(arguments: list[str]) -> None:
    """Train one embedding; an interrupted training continues."""
    params = load_params()
    headline = params.evidence.headline
    embedding, seed = choose_each(
        arguments, {"EMBEDDING": [headline.embedding], "SEED": headline.seeds}, "headline/embed.py"
    )
    cell = params.embeddings[embedding].model_copy(update={"iterations": headline.embedding_iterations})
    objective = EmbeddingObjective(cell, params.training, int(seed), open_dataset(cell.dataset))
    name = paths.replicate(paths.headline(embedding), int(seed))
    fit(name, objective, paths.model(name))


if __name__ == "__main__":
    run_stage(main)
