"""Stage `headline-imitate`: policies of a method with one of its models, into data/policies/headline-<...>.

Usage, in evidence/: python headline/imitate.py CELL SEED
"""

from anyview import paths
from anyview.config import load_params
from anyview.evaluation.methods import MakeLearner, Method
from anyview.evaluation.stage import evaluate_method
from anyview.learners import ddpg, trpo
from anyview.rewards.cells import make_reward
from anyview.runtime.errors import choose_each, run_stage

LEARNERS: dict[str, MakeLearner] = {"ddpg": ddpg.make_learner, "trpo": trpo.make_learner}


def main(arguments: list[str]) -> None:
    """Evaluate one model at full budget; a killed stage continues from its checkpoints."""
    params = load_params()
    headline = params.evidence.headline
    cell_name, seed = choose_each(
        arguments, {"CELL": headline.cells, "SEED": headline.seeds}, "headline/imitate.py"
    )
    cell = params.imitation.cells[cell_name]
    model = paths.replicate(paths.headline(cell.model), int(seed))
    name = paths.replicate(paths.headline(cell_name), int(seed))
    changed = {"cells": {name: cell.model_copy(update={"model": model})}, **headline.policies}
    params = params.model_copy(update={"imitation": params.imitation.model_copy(update=changed)})
    method = Method(LEARNERS[cell.learner], make_reward)
    evaluate_method(name, params, method, [paths.model(model)])


if __name__ == "__main__":
    run_stage(main)
