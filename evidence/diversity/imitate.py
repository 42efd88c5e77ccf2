"""Stage `diversity-imitate`: policies of `ours` with one such translator, into data/policies/views-<...>.

Usage, in evidence/: python diversity/imitate.py VIEWS CLUTTER DEMONSTRATIONS SEED EVALUATION
"""

from anyview import paths
from anyview.config import DemonstrationCell, load_params
from anyview.diversity.sets import restriction
from anyview.evaluation.methods import Method
from anyview.evaluation.stage import evaluate_method
from anyview.learners import ddpg
from anyview.rewards.cells import make_reward
from anyview.runtime.errors import AnyviewError, choose_each, run_stage


def main(arguments: list[str]) -> None:
    """Evaluate one translator in one way; a killed stage continues from its checkpoints."""
    params = load_params()
    diversity, imitation, sets = params.evidence.diversity, params.imitation, params.simulate.sets
    views, clutter, demonstrations, seed, evaluation = choose_each(
        arguments,
        {
            "VIEWS": diversity.views,
            "CLUTTER": paths.CLUTTER,
            "DEMONSTRATIONS": diversity.demonstrations,
            "SEED": diversity.seeds,
            "EVALUATION": paths.EVALUATIONS,
        },
        "diversity/imitate.py",
    )
    dataset = paths.restricted_set(views, clutter)
    model = paths.replicate(f"{dataset}-{demonstrations}", int(seed))
    name = f"{model}-{evaluation}"
    ours = imitation.cells.get("ours")
    if not isinstance(ours, DemonstrationCell) or (ours.learner, ours.reward) != ("ddpg", "translated"):
        raise AnyviewError("params.yaml: imitation.cells.ours: must be of ddpg and translated demonstrations")
    changed: dict[str, object] = {
        "cells": {name: ours.model_copy(update={"model": model})},
        **diversity.policies,
    }
    if evaluation != "diverse":
        changed["dataset"] = dataset
    params = params.model_copy(
        update={
            "imitation": imitation.model_copy(update=changed),
            "simulate": params.simulate.model_copy(
                update={"sets": {**sets, dataset: sets[imitation.dataset]}}
            ),
        }
    )
    method = Method(ddpg.make_learner, make_reward)
    change = restriction(views, clutter) if evaluation == "own" else None
    evaluate_method(name, params, method, [paths.model(model)], change)


if __name__ == "__main__":
    run_stage(main)
