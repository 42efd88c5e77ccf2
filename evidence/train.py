"""Stage `train` of the evidence: one of several translators of a cell, into data/models/<cell>-seed-<seed>.

Usage, in evidence/: python train.py TRANSLATOR SEED
"""

from anyview import paths
from anyview.config import load_params
from anyview.runtime.errors import choose, run_stage
from anyview.training.common.fit import fit
from anyview.training.translator import TranslatorObjective
from anyview.video.datasets import open_dataset

USAGE = "python train.py TRANSLATOR"


def main(arguments: list[str]) -> None:
    """Train one translator; an interrupted training continues."""
    params = load_params()
    evidence = params.evidence
    translator = choose(arguments[:1], evidence.translators, USAGE)
    seed = int(choose(arguments[1:], list(map(str, evidence.seeds)), f"{USAGE} SEED"))
    cell = params.translators[translator].model_copy(update={"iterations": evidence.iterations})
    # One seed is the same first weights and the same batches for every cell: they differ in their losses.
    objective = TranslatorObjective(cell, params.training, seed, open_dataset(cell.dataset))
    name = paths.replicate(translator, seed)
    fit(name, objective, paths.model(name))


if __name__ == "__main__":
    run_stage(main)
