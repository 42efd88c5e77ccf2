"""Stage `losses-train`: one of several translators of a cell, into data/models/<cell>-seed-<seed>.

Usage, in evidence/: python losses/train.py TRANSLATOR SEED
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
    losses = params.evidence.losses
    translator, seed = choose_each(
        arguments, {"TRANSLATOR": losses.translators, "SEED": losses.seeds}, "losses/train.py"
    )
    cell = params.translators[translator].model_copy(update={"iterations": losses.translator_iterations})
    # One seed is the same first weights and the same batches for every cell: they differ in their losses.
    objective = TranslatorObjective(cell, params.training, int(seed), open_dataset(cell.dataset))
    name = paths.replicate(translator, int(seed))
    fit(name, objective, paths.model(name))


if __name__ == "__main__":
    run_stage(main)
