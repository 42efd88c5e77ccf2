"""What stages `imitate` and `discriminate` do: from a cell of params.yaml to the folder of its policies."""

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from anyview import paths
from anyview.config import Params
from anyview.evaluation.demonstrations import (
    Clips,
    angled_demonstrations,
    clock_clips,
    imitated_demonstrations,
    own_demonstrations,
    rig_demonstrations,
    two_goals,
)
from anyview.evaluation.methods import Method
from anyview.evaluation.runs import Work, evaluate_group, groups_of
from anyview.learners.common.policies import save_policies
from anyview.pusher.contexts import COLOURS, Colour, Context, Kind, sample_contexts
from anyview.runtime.outputs import whole_folder, write_atomically
from anyview.runtime.scratch import checkpoint_folder
from anyview.runtime.workers import run_tasks
from anyview.seeds import stream
from anyview.video.datasets import dataset_files
from anyview.video.files import write_video

RATE = 10.0  # frames a second


class Setting(NamedTuple):
    """What all contexts of a method are shown: clips that go to one goal, or were filmed from one angle."""

    contexts: list[Context]
    clips: Clips
    choice: Colour | None = None
    angle: int | None = None

    def of(self, group: Sequence[int]) -> tuple[list[Context], np.ndarray]:
        """Contexts and clips of a group of them; see ``Group.demonstrations``."""
        frames = self.clips.frames
        own = frames.ndim == 6
        return [self.contexts[context] for context in group], frames[list(group)] if own else frames

    def named(self) -> dict[str, str | int]:
        """What distinguishes the setting from others of the same method."""
        names = {"choice": self.choice, "angle": self.angle}
        return {name: value for name, value in names.items() if value is not None}


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

    Every context is run once in each of the cell's ``settings``. Where clips are told apart by their choice
    or angle, ``runs.csv`` has the column ``context``, and both tables have ``choice`` or ``angle``.
    """
    shown = params.methods[name].shown
    contexts = draw_contexts(params, shown.contexts, params.imitation.runs)
    every = settings(name, params, [change(context) for context in contexts] if change else contexts)
    numbers = groups_of(params.imitation.runs, params.imitation.group)
    values, files = origin(name, params, sources)
    tasks: list[tuple[Work, Path]] = []
    acted: list[Context] = []
    tables = []
    for setting in every:
        for group in numbers:
            runs = [len(acted) + run for run in group]
            scratch = checkpoint_folder([*values, len(tasks)], files)
            tasks.append((Work(name, params, method, runs, *setting.of(group)), scratch))
        acted += setting.contexts
        table = pd.DataFrame({"clip": setting.clips.names} | setting.named())
        if shown.own_clips:
            table["context"] = np.repeat(np.arange(params.imitation.runs), params.imitation.demonstrations)
        tables.append(table)
    results = list(run_tasks(evaluate_group, tasks))
    runs = pd.concat([result.runs for result in results], ignore_index=True)
    curve = pd.concat([result.curve for result in results], ignore_index=True)
    named = pd.DataFrame([setting.named() for setting in every])
    if len(named.columns):
        runs.insert(1, "context", runs["run"] % params.imitation.runs)
        for place, column in enumerate(named, 2):
            runs.insert(place, column, np.repeat(named[column].to_numpy(), params.imitation.runs))
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
    for _, scratch in tasks:
        shutil.rmtree(scratch)
    distance = 100 * runs["final_distance"].median()
    print(f"{name}: {runs['success'].sum()} of {len(runs)} succeed; median distance {distance:.1f} cm")


def draw_contexts(params: Params, name: str, count: int) -> list[Context]:
    """``count`` contexts to act in, with as many goals as the clips have, from the random stream ``name``."""
    kind: Kind = "choice" if two_goals(params) else "diverse"
    rng = stream(params.base.seed, name if kind == "diverse" else f"{name}/{kind}")
    task = params.demonstration_sets[params.imitation.dataset].task
    return sample_contexts(rng, count, kind, task)[0]


def settings(name: str, params: Params, contexts: list[Context]) -> list[Setting]:
    """What cell ``name`` is shown in ``contexts``.

    One setting; or where clips choose between two goals, or are chosen by their angle, one for each of these.
    """
    cell = params.methods[name]
    choices: tuple[Colour | None, ...] = COLOURS if two_goals(params) else (None,)
    angles: Sequence[int | None] = cell.shown.angles or (None,)

    def clips(choice: Colour | None, angle: int | None) -> Clips:
        if angle is not None:
            return angled_demonstrations(params, contexts, angle, choice)
        if cell.shown.own_clips:
            return own_demonstrations(params, len(contexts), choice)
        if cell.shown.other_experts:
            return rig_demonstrations(params, cell.shown.other_experts)
        clock = cell.reward == "clock"
        return clock_clips(params) if clock else imitated_demonstrations(params, choice)

    return [
        Setting(
            [context.choosing(choice) if choice else context for context in contexts],
            clips(choice, angle),
            choice,
            angle,
        )
        for angle in angles
        for choice in choices
    ]


def origin(name: str, params: Params, sources: Sequence[Path]) -> tuple[list[Any], list[Path]]:
    """The values and files that the checkpoints of a cell depend on."""
    values = params.model_dump(include={"base", "sim", "imitation", "adversarial"})
    for block in ("imitation", "adversarial"):
        values[block]["cells"] = values[block]["cells"].get(name)
    other = params.methods[name].shown.other_experts
    datasets = [params.imitation.dataset, *([other] if other else [])]
    files = [file for dataset in datasets for file in dataset_files(dataset)]
    return [name, values], files + [file for source in sources for file in sorted(source.iterdir())]
