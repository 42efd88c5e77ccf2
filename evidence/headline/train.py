"""Stage `headline-train`: one of several translators at full budget, into data/models/headline-<...>.

Usage, in evidence/: python headline/train.py TRANSLATOR SEED
"""

from anyview import paths
from anyview.config import load_params
from anyview.runtime.errors import choose_each, run_stage
from anyview.training.common.fit import fit
from anyview.training.translator import TranslatorObjective
from anyview.video.datasets import open_dataset


def main(arguments: list[str]) -> None:
    """Train one translator; an interrupted training continues."""
    params = load_params()
    headline = params.evidence.headline
    translator, seed = choose_each(
        arguments, {"TRANSLATOR": [headline.translator], "SEED": headline.seeds}, "headline/train.py"
    )
    cell = params.translators[translator].model_copy(update={"iterations": headline.translator_iterations})
    objective = TranslatorObjective(cell, params.training, int(seed), open_dataset(cell.dataset))
    name = paths.replicate(paths.headline(translator), int(seed))
    fit(name, objective, paths.model(name))


if __name__ == "__main__":
    run_stage(main)
