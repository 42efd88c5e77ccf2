"""Stage `train`: one translator cell, or the embedding of the `tcn` baseline, into data/models/<cell>.

Usage: python stages/train.py CELL [DATASET]
"""

from pathlib import Path

from anyview.config import EmbeddingCell, load_params
from anyview.runtime.errors import AnyviewError, run_stage
from anyview.training.sampling import check_dataset
from anyview.training.trainer import Recipe
from anyview.training.training import train_translator


def main(arguments: list[str]) -> None:
    """Train one cell; an interrupted training continues."""
    params = load_params()
    cells = params.translation.cells
    if len(arguments) not in (1, 2) or arguments[0] not in cells:
        raise AnyviewError(f"usage: python stages/train.py CELL, where CELL is one of {', '.join(cells)}")
    name = arguments[0]
    cell = cells[name]
    check_dataset(name, cell.dataset, arguments[1:])
    output = Path("data/models") / name
    if isinstance(cell, EmbeddingCell):
        from anyview.embedding.embedding import train_embedding

        train_embedding(name, cell, params.translation.training, params.base.seed, output)
    else:
        train_translator(Recipe(name, cell, params.translation.training, params.base.seed), output)


if __name__ == "__main__":
    run_stage(main)
