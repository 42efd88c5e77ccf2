"""Stage `imitate` of the evidence: policies of `ours` with one translator, into data/policies/<...>.

Usage, in evidence/: python imitate.py TRANSLATOR SEED REWARD
"""

from anyview import paths
from anyview.config import DemonstrationCell, load_params
from anyview.evaluation.methods import Method
from anyview.evaluation.stage import evaluate_method
from anyview.learners import ddpg
from anyview.rewards.cells import make_reward
from anyview.runtime.errors import AnyviewError, choose, run_stage

USAGE = "python imitate.py TRANSLATOR"


def main(arguments: list[str]) -> None:
    """Evaluate one translator in the contexts of the study; a killed stage continues."""
    params = load_params()
    evidence = params.evidence
    translator = choose(arguments[:1], evidence.translators, USAGE)
    seed = int(choose(arguments[1:2], list(map(str, evidence.seeds)), f"{USAGE} SEED"))
    reward = choose(arguments[2:], evidence.rewards, f"{USAGE} SEED REWARD")
    model, name = paths.replicate(translator, seed), paths.replicate(translator, seed, reward)
    ours = params.imitation.cells.get("ours")
    if not isinstance(ours, DemonstrationCell) or (ours.learner, ours.reward) != ("ddpg", "translated"):
        raise AnyviewError("params.yaml: imitation.cells.ours: must be of ddpg and translated demonstrations")
    cell = ours.model_copy(update={"model": model, "weights": evidence.rewards[reward]})
    imitation = params.imitation.model_copy(update={"cells": {name: cell}})
    method = Method(ddpg.make_learner, make_reward)
    evaluate_method(name, params.model_copy(update={"imitation": imitation}), method, [paths.model(model)])


if __name__ == "__main__":
    run_stage(main)
