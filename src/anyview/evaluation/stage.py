"""What stages `imitate` and `discriminate` do: from a cell of params.yaml to the folder of its policies."""

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from anyview import paths
from anyview.config import Params
from anyview.evaluation.demonstrations import (
    Clips,
    clock_clips,
    imitated_demonstrations,
    own_demonstrations,
    rig_demonstrations,
    two_goals,
)
from anyview.evaluation.methods import Method
from anyview.evaluation.runs import evaluate_group, groups_of
from anyview.learners.common.policies import save_policies
from anyview.pusher.contexts import COLOURS, Colour, Context, Kind, sample_contexts
from anyview.runtime.outputs import whole_folder, write_atomically
from anyview.runtime.scratch import checkpoint_folder
from anyview.runtime.workers import run_tasks
from anyview.seeds import stream
from anyview.video.datasets import dataset_files
from anyview.video.files import write_video

RATE = 10.0  # frames a second


def evaluate_method(
    name: str,
    params: Params,
    method: Method,
    sources: Sequence[Path],
    change: Callable[[Context], Context] | None = None,
) -> None:
    """Train and evaluate the policies of cell ``name`` into its folder; continues from its checkpoints.

    ``sources`` are the folders that its reward is made from, beside the demonstrations. ``change`` makes of
    each context the one to act in; the name has to tell which.

    - ``runs.csv``: a row for each run, and how it ended;
    - ``curve.csv``: the learning curve of each run;
    - ``policy-<run>.safetensors`` and ``policy.json``: see ``learners.common.policies``;
    - ``rollouts/run-<run>.avi``: the agent's frames with the imitated demonstration to their right;
    - ``demonstrations.csv``: the clips that are imitated, with their ``context`` if each has its own.

    Where the demonstrations choose between two goals, every context is run twice: first all of them with
    clips of the one choice, then all with clips of the other. ``runs.csv`` has the columns ``context`` and
    ``choice`` then, and ``demonstrations.csv`` has ``choice``.
    """
    own = params.methods[name].shown.own_clips
    imitated = _imitated(name, params, change or (lambda context: context))
    numbers = groups_of(params.imitation.runs, params.imitation.group)
    values, files = _origin(name, params, sources)
    tasks: list[tuple[Any, ...]] = []
    acted: list[Context] = []
    tables = []
    for choice, contexts, clips in imitated:
        for group in numbers:
            runs = [len(acted) + run for run in group]
            scratch = checkpoint_folder([*values, len(tasks)], files)
            theirs = [contexts[run] for run in group]
            frames = clips.frames[group] if own else clips.frames
            tasks.append((name, params, method, runs, theirs, frames, scratch))
        acted += contexts
        table = pd.DataFrame({"clip": clips.names} | ({"choice": choice} if choice else {}))
        if own:
            table["context"] = np.repeat(np.arange(len(contexts)), params.imitation.demonstrations)
        tables.append(table)
    results = list(run_tasks(evaluate_group, tasks))
    runs = pd.concat([result.runs for result in results], ignore_index=True)
    curve = pd.concat([result.curve for result in results], ignore_index=True)
    if len(imitated) > 1:
        runs.insert(1, "context", runs["run"] % params.imitation.runs)
        runs.insert(2, "choice", [context.choice.colour for context in acted if context.choice])
    with whole_folder(paths.policies(name)) as output:
        write_atomically(output / "demonstrations.csv", pd.concat(tables).to_csv(index=False))
        write_atomically(output / "runs.csv", runs.to_csv(index=False))
        write_atomically(output / "curve.csv", curve.sort_values(["iteration", "run"]).to_csv(index=False))
        weights = {
            each: np.concatenate([result.policies[each] for result in results])
            for each in results[0].policies
        }
        learner, sim = params.methods[name].learner, params.sim
        save_policies(output, weights, acted, learner, sim.control, sim.image_size)
        (output / "rollouts").mkdir()
        for run, rollout in enumerate(np.concatenate([result.rollouts for result in results])):
            write_video(output / "rollouts" / f"run-{run:02d}.avi", rollout, RATE)
    for *_, scratch in tasks:
        shutil.rmtree(scratch)
    distance = 100 * runs["final_distance"].median()
    print(f"{name}: {runs['success'].sum()} of {len(runs)} succeed; median distance {distance:.1f} cm")


def draw_contexts(params: Params, name: str, count: int) -> list[Context]:
    """``count`` contexts to act in, with as many goals as the clips have, from the random stream ``name``."""
    kind: Kind = "choice" if two_goals(params) else "diverse"
    rng = stream(params.base.seed, name if kind == "diverse" else f"{name}/{kind}")
    task = params.demonstration_sets[params.imitation.dataset].task
    return sample_contexts(rng, count, kind, task)[0]


def _imitated(
    name: str, params: Params, change: Callable[[Context], Context]
) -> list[tuple[Colour | None, list[Context], Clips]]:
    """For each choice, or the only task: the contexts to act in and the clips that are imitated there."""
    cell = params.methods[name]
    contexts = [
        change(context) for context in draw_contexts(params, cell.shown.contexts, params.imitation.runs)
    ]

    def clips(choice: Colour | None = None) -> Clips:
        if cell.shown.own_clips:
            return own_demonstrations(params, len(contexts), choice)
        if cell.shown.other_experts:
            return rig_demonstrations(params, cell.shown.other_experts)
        clock = cell.reward == "clock"
        return clock_clips(params) if clock else imitated_demonstrations(params, choice)

    if not two_goals(params):
        return [(None, contexts, clips())]
    return [(choice, [context.choosing(choice) for context in contexts], clips(choice)) for choice in COLOURS]


def _origin(name: str, params: Params, sources: Sequence[Path]) -> tuple[list[Any], list[Path]]:
    """The values and files that the checkpoints of a cell depend on."""
    values = params.model_dump(include={"base", "sim", "imitation", "adversarial"})
    for block in ("imitation", "adversarial"):
        values[block]["cells"] = values[block]["cells"].get(name)
    other = params.methods[name].shown.other_experts
    datasets = [params.imitation.dataset, *([other] if other else [])]
    files = [file for dataset in datasets for file in dataset_files(dataset)]
    return [name, values], files + [file for source in sources for file in sorted(source.iterdir())]
