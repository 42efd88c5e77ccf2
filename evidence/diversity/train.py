"""Stage `diversity-train`: one translator of some demonstrations of a set, into data/models/views-<...>.

Usage, in evidence/: python diversity/train.py VIEWS CLUTTER DEMONSTRATIONS SEED
"""

from anyview import paths
from anyview.config import load_params
from anyview.diversity.sets import some_demonstrations
from anyview.runtime.errors import choose_each, run_stage
from anyview.seeds import torch_seed
from anyview.training.common.fit import fit
from anyview.training.translator import TranslatorObjective
from anyview.video.datasets import open_dataset


def main(arguments: list[str]) -> None:
    """Train one translator; an interrupted training continues."""
    params = load_params()
    diversity = params.evidence.diversity
    views, clutter, demonstrations, seed = choose_each(
        arguments,
        {
            "VIEWS": diversity.views,
            "CLUTTER": paths.CLUTTER,
            "DEMONSTRATIONS": diversity.demonstrations,
            "SEED": diversity.seeds,
        },
        "diversity/train.py",
    )
    dataset = paths.restricted_set(views, clutter)
    cell = params.translators[diversity.translator].model_copy(
        update={"dataset": dataset, "iterations": diversity.translator_iterations}
    )
    clips = some_demonstrations(open_dataset(dataset), int(demonstrations), int(seed))
    name = paths.replicate(f"{dataset}-{demonstrations}", int(seed))
    # Weights and draws of its own: the luck of a seed is then no part of what two cells have in common.
    objective = TranslatorObjective(cell, params.training, torch_seed(int(seed), name), clips)
    fit(name, objective, paths.model(name))


if __name__ == "__main__":
    run_stage(main)
