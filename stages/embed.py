"""Stage `embed`: the time-contrastive embedding of one cell, into data/models/<cell>.

Usage: python stages/embed.py CELL
"""

from pathlib import Path

from anyview.config import EmbeddingCell, load_params
from anyview.runtime.errors import AnyviewError, run_stage
from anyview.training.embedding import EmbeddingObjective
from anyview.training.fit import fit
from anyview.video.datasets import open_dataset


def main(arguments: list[str]) -> None:
    """Train one embedding; an interrupted training continues."""
    params = load_params()
    cells = {name: cell for name, cell in params.translation.cells.items() if isinstance(cell, EmbeddingCell)}
    if len(arguments) != 1 or arguments[0] not in cells:
        raise AnyviewError(f"usage: python stages/embed.py CELL, where CELL is one of {', '.join(cells)}")
    name = arguments[0]
    cell = cells[name]
    dataset = open_dataset(cell.dataset)
    objective = EmbeddingObjective(cell, params.translation.training, params.base.seed, dataset)
    fit(name, objective, Path("data/models") / name)


if __name__ == "__main__":
    run_stage(main)
