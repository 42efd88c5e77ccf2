"""Stage `losses-imitate`: policies of `ours` with one translator, into data/policies/<...>.

Usage, in evidence/: python losses/imitate.py TRANSLATOR SEED REWARD
"""

from anyview import paths
from anyview.config import DemonstrationCell, load_params
from anyview.evaluation.methods import Method
from anyview.evaluation.stage import evaluate_method
from anyview.learners import ddpg
from anyview.rewards.cells import make_reward
from anyview.runtime.errors import AnyviewError, choose_each, run_stage


def main(arguments: list[str]) -> None:
    """Evaluate one translator in the contexts of the study; a killed stage continues."""
    params = load_params()
    losses = params.evidence.losses
    translator, seed, reward = choose_each(
        arguments,
        {"TRANSLATOR": losses.translators, "SEED": losses.seeds, "REWARD": losses.every_reward},
        "losses/imitate.py",
    )
    model, name = paths.replicate(translator, int(seed)), paths.replicate(translator, int(seed), reward)
    ours = params.imitation.cells.get("ours")
    if not isinstance(ours, DemonstrationCell) or (ours.learner, ours.reward) != ("ddpg", "translated"):
        raise AnyviewError("params.yaml: imitation.cells.ours: must be of ddpg and translated demonstrations")
    cell = ours.model_copy(update={"model": model, "weights": losses.every_reward[reward]})
    imitation = params.imitation.model_copy(update={"cells": {name: cell}, **losses.policies})
    method = Method(ddpg.make_learner, make_reward)
    evaluate_method(name, params.model_copy(update={"imitation": imitation}), method, [paths.model(model)])


if __name__ == "__main__":
    run_stage(main)
