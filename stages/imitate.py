"""Stage `imitate`: policies rewarded by demonstrations, and how they end, into data/policies/<cell>.

Usage: python stages/imitate.py CELL
"""

from anyview import paths
from anyview.config import load_params
from anyview.evaluation.methods import MakeLearner, Method
from anyview.evaluation.stage import evaluate_method
from anyview.learners import ddpg, trpo
from anyview.rewards.cells import make_reward
from anyview.runtime.errors import choose, run_stage

LEARNERS: dict[str, MakeLearner] = {"ddpg": ddpg.make_learner, "trpo": trpo.make_learner}


def main(arguments: list[str]) -> None:
    """Evaluate one cell; a killed stage continues from its checkpoints."""
    params = load_params()
    cells = {**params.imitation.cells, **params.beyond.cells}
    name = choose(arguments, cells, "python stages/imitate.py CELL")
    if name in params.beyond.cells:
        params = params.imitating(name)
    method = Method(LEARNERS[cells[name].learner], make_reward)
    evaluate_method(name, params, method, [paths.model(cells[name].model)])


if __name__ == "__main__":
    run_stage(main)
