"""Stage `rank`: whether rewards rank scripted failures below successes, into data/rankings."""

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from anyview import paths
from anyview.adversarial import gail, tpil
from anyview.config import AdversarialCell, Params, load_params
from anyview.evaluation.methods import MakeLearner, MakeReward, Method
from anyview.evaluation.runs import Work, groups_of
from anyview.evaluation.stage import draw_contexts, origin, settings
from anyview.learners import ddpg, trpo
from anyview.ranking.rollouts import scripted_rollouts
from anyview.ranking.scores import score_group
from anyview.rewards import cells
from anyview.runtime.errors import refuse_arguments, run_stage
from anyview.runtime.outputs import whole_folder, write_atomically
from anyview.runtime.progress import track
from anyview.runtime.scratch import checkpoint_folder
from anyview.runtime.workers import run_tasks
from anyview.seeds import stream

LEARNERS: dict[str, MakeLearner] = {"ddpg": ddpg.make_learner, "trpo": trpo.make_learner}
LEARNED: dict[str, MakeReward] = {"gail": gail.make_reward, "tpil": tpil.make_reward}
CONTEXTS = "tuning"  # the random stream: no evaluation uses them


def group_tasks(name: str, params: Params) -> list[tuple[Any, ...]]:
    """The arguments of ``score_group`` for every group of runs of one method."""
    cell = params.methods[name]
    method = Method(LEARNERS[cell.learner], LEARNED.get(cell.reward, cells.make_reward))
    models = [] if isinstance(cell, AdversarialCell) else [paths.model(cell.model)]
    values, files = origin(name, params, models)
    tasks: list[tuple[Any, ...]] = []
    contexts = draw_contexts(params, CONTEXTS, params.imitation.runs)
    for number, setting in enumerate(settings(name, params, contexts)):
        rng = stream(params.base.seed, "scripted", number)
        scripted = scripted_rollouts(setting.contexts, params.beyond.ranking.rollouts, rng)
        for group in groups_of(params.imitation.runs, params.imitation.group):
            runs = [number * params.imitation.runs + run for run in group]
            own = {kind: positions[list(group)] for kind, positions in scripted.items()}
            scratch = checkpoint_folder(["rank", *values, len(tasks)], files)
            tasks.append((Work(name, params, method, runs, *setting.of(group)), own, scratch))
    return tasks


def write_table(path: Path, works: Sequence[Work], tables: Sequence[pd.DataFrame]) -> None:
    """Write the tables of all groups as one, with each row's method and context."""
    table = pd.concat(
        [
            table.assign(cell=work.cell, context=table["run"] % work.params.imitation.runs)
            for work, table in zip(works, tables, strict=True)
        ]
    )
    first = ["cell", "context"]
    table = table[first + [column for column in table if column not in first]]
    write_atomically(path, table.to_csv(index=False, float_format="%.6g"))


def main(arguments: list[str]) -> None:
    """Score by every reward; rewards that learn continue from their checkpoints."""
    refuse_arguments(arguments, "python stages/rank.py")
    params = load_params()
    beyond = params.beyond
    tasks = [
        task
        for name in beyond.ranking.methods
        for task in group_tasks(name, params.imitating(name) if name in beyond.cells else params)
    ]
    scores = []
    with track("rank", len(tasks)) as progress:
        for score in run_tasks(score_group, tasks):
            scores.append(score)
            progress.advance()
    works = [work for work, *_ in tasks]
    with whole_folder(paths.RANKINGS) as output:
        for file, tables in zip(("rollouts.csv", "values.csv"), zip(*scores, strict=True), strict=True):
            write_table(output / file, works, tables)
    for *_, scratch in tasks:
        shutil.rmtree(scratch)


if __name__ == "__main__":
    run_stage(main)
