"""Stage `translate`: what a trained translator makes of held-out clips, into data/translations/<cell>.

Usage: python stages/translate.py CELL
"""

from pathlib import Path

from anyview.assessment.evaluation import evaluate
from anyview.config import TranslatorCell, load_params
from anyview.runtime.errors import AnyviewError, run_stage
from anyview.runtime.outputs import whole_folder
from anyview.seeds import stream
from anyview.translator.weights import load_translator
from anyview.video.datasets import open_dataset


def main(arguments: list[str]) -> None:
    """Evaluate the translator of one cell."""
    params = load_params()
    cells = {
        name: cell for name, cell in params.translation.cells.items() if isinstance(cell, TranslatorCell)
    }
    if len(arguments) != 1 or arguments[0] not in cells:
        raise AnyviewError(f"usage: python stages/translate.py CELL, where CELL is one of {', '.join(cells)}")
    name = arguments[0]
    model = load_translator(Path("data/models") / name)
    dataset = open_dataset(cells[name].dataset)
    with whole_folder(Path("data/translations") / name) as folder:
        rng = stream(params.base.seed, f"translate/{name}")
        evaluate(model, dataset, folder, params.translation.evaluation, rng)


if __name__ == "__main__":
    run_stage(main)
