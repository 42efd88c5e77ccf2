"""Stage `imitate`: train and evaluate the policies of one cell, into data/policies/<cell>.

Usage: python stages/imitate.py CELL
"""

import shutil
from pathlib import Path

import numpy as np
import pandas as pd

from anyview.config import Params, load_params
from anyview.evaluation.demonstrations import DEMONSTRATIONS, SPLIT, imitated_demonstrations
from anyview.evaluation.runs import evaluate_group, groups_of
from anyview.learners.common.policies import save_policies
from anyview.pusher.contexts import sample_contexts
from anyview.runtime.errors import AnyviewError, run_stage
from anyview.runtime.outputs import whole_folder, write_atomically
from anyview.runtime.scratch import content_key, scratch_folder
from anyview.runtime.workers import run_units
from anyview.seeds import stream
from anyview.video.files import write_video

RATE = 10.0  # frames a second


def main(arguments: list[str]) -> None:
    """Evaluate the cell named on the command line; a killed stage continues from its checkpoints."""
    params = load_params()
    cells = params.imitation.cells
    if len(arguments) != 1 or arguments[0] not in cells:
        raise AnyviewError(f"usage: python stages/imitate.py CELL, where CELL is one of {', '.join(cells)}")
    name = arguments[0]
    contexts, _ = sample_contexts(stream(params.base.seed, "evaluation"), params.imitation.runs)
    chosen, demonstrations = imitated_demonstrations(params)
    key = _key(params, name)
    groups = groups_of(len(contexts))
    scratch = [scratch_folder("checkpoints", f"{key}-{index}") for index in range(len(groups))]
    units = [
        (name, params, group, [contexts[run] for run in group], demonstrations, folder)
        for group, folder in zip(groups, scratch, strict=True)
    ]
    results = list(run_units(evaluate_group, units))
    runs = pd.concat([result.runs for result in results], ignore_index=True)
    curve = pd.concat([result.curve for result in results], ignore_index=True)
    with whole_folder(Path("data/policies") / name) as output:
        write_atomically(output / "demonstrations.csv", pd.DataFrame({"clip": chosen}).to_csv(index=False))
        write_atomically(output / "runs.csv", runs.to_csv(index=False))
        write_atomically(output / "curve.csv", curve.sort_values(["iteration", "run"]).to_csv(index=False))
        weights = {
            each: np.concatenate([result.policies[each] for result in results])
            for each in results[0].policies
        }
        save_policies(
            output, weights, contexts, cells[name].learner, params.sim.control, params.sim.image_size
        )
        (output / "rollouts").mkdir()
        for run, rollout in enumerate(np.concatenate([result.rollouts for result in results])):
            write_video(output / "rollouts" / f"run-{run:02d}.avi", rollout, RATE)
    for folder in scratch:
        shutil.rmtree(folder)
    distance = 100 * runs["final_distance"].median()
    print(f"{name}: {runs['success'].sum()} of {len(runs)} succeed; median distance {distance:.1f} cm")


def _key(params: Params, name: str) -> str:
    """Changes with everything that the checkpoints of a cell depend on."""
    values = params.imitation.model_dump(exclude={"cells"}) | params.imitation.cells[name].model_dump()
    files = [DEMONSTRATIONS / "files.csv", SPLIT]
    source = Path(params.imitation.cells[name].source)
    files += sorted(source.iterdir()) if source.is_dir() else []
    return content_key([name, params.base.seed, params.sim.model_dump(), values], files)


if __name__ == "__main__":
    run_stage(main)
