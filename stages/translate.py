"""Stage `translate`: what a trained translator makes of held-out clips, into data/translations/<cell>.

Usage: python stages/translate.py CELL
"""

from anyview import paths
from anyview.assessment.evaluation import evaluate
from anyview.config import load_params
from anyview.runtime.errors import choose, run_stage
from anyview.runtime.outputs import whole_folder
from anyview.seeds import stream
from anyview.translator.weights import load_translator
from anyview.video.datasets import open_dataset


def main(arguments: list[str]) -> None:
    """Evaluate the translator of one cell."""
    params = load_params()
    name = choose(arguments, params.translator_cells, "python stages/translate.py CELL")
    model = load_translator(paths.model(name))
    cell = params.translator_cells[name]
    dataset = open_dataset(cell.dataset, cell.other_experts)
    with whole_folder(paths.translations(name)) as folder:
        rng = stream(params.base.seed, f"translate/{name}")
        evaluate(model, dataset, folder, params.assessment, rng)


if __name__ == "__main__":
    run_stage(main)
