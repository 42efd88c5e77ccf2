"""Stage `imitate`: policies rewarded by demonstrations, and how they end, into data/policies/<cell>.

Usage: python stages/imitate.py CELL
"""

from anyview import paths
from anyview.config import load_params
from anyview.evaluation.stage import evaluate_method
from anyview.rewards.cells import make_reward
from anyview.runtime.errors import choose, run_stage


def main(arguments: list[str]) -> None:
    """Evaluate one cell; a killed stage continues from its checkpoints."""
    params = load_params()
    cells = params.imitation.cells
    name = choose(arguments, cells, "python stages/imitate.py CELL")
    evaluate_method(name, params, make_reward, [paths.model(cells[name].model)])


if __name__ == "__main__":
    run_stage(main)
