"""Stage `discriminate`: policies whose reward a discriminator learns (TPIL, GAIL), into data/policies/<cell>.

Usage: python stages/discriminate.py CELL
"""

from anyview.adversarial import gail, tpil
from anyview.config import load_params
from anyview.evaluation.methods import MakeLearner, Method
from anyview.evaluation.stage import evaluate_method
from anyview.learners import ddpg, trpo
from anyview.runtime.errors import choose, run_stage

LEARNERS: dict[str, MakeLearner] = {"ddpg": ddpg.make_learner, "trpo": trpo.make_learner}
REWARDS = {"gail": gail.make_reward, "tpil": tpil.make_reward}


def main(arguments: list[str]) -> None:
    """Evaluate one cell; a killed stage continues from its checkpoints."""
    params = load_params()
    cells = params.adversarial.cells
    name = choose(arguments, cells, "python stages/discriminate.py CELL")
    method = Method(LEARNERS[cells[name].learner], REWARDS[cells[name].reward])
    evaluate_method(name, params, method, sources=[])


if __name__ == "__main__":
    run_stage(main)
