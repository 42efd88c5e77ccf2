"""From one clip to one policy: which translator, which context, and one run of the study's own learner."""

import hashlib
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anyview import paths
from anyview.cli.footage import find_clip, read_clip
from anyview.config import DemonstrationCell, LossWeights, Params, RewardWeights, load_params
from anyview.evaluation.methods import Method
from anyview.evaluation.runs import Work, evaluate_group
from anyview.evaluation.stage import RATE, draw_contexts
from anyview.learners import ddpg
from anyview.learners.common.policies import save_policies
from anyview.pusher.batch import FRAMES
from anyview.pusher.contexts import COLOURS, Colour, Context
from anyview.pusher.task import load_task
from anyview.rewards.cells import make_reward
from anyview.runtime.errors import AnyviewError
from anyview.runtime.outputs import whole_folder, write_atomically
from anyview.runtime.scratch import checkpoint_folder
from anyview.sharing.checksums import find_model
from anyview.translator.weights import read_meta
from anyview.video.files import write_video
from anyview.video.phases import frames_in_step, seconds_of
from anyview.video.pictures import resize
from anyview.video.sets import read_stored

VIDEO = "rollout.mp4"
_NAME = "imitate"  # of the method, and of the stream of fresh contexts
_WIDTH = 256  # pixels, at least, of a view in the video


@dataclass(frozen=True)
class Task:
    """What is imitated, by which translator and where. ``clip`` is uint8 RGB (50, H, W, 3)."""

    params: Params
    model: Path
    clip: np.ndarray
    context: Context
    shown: Colour | None
    """The goal that the clip goes to, where there are two and its set tells."""


@dataclass(frozen=True)
class Outcome:
    """Metres that are left to each goal, by colour; less than ``tolerance`` is a success."""

    distances: dict[Colour, float]
    shown: Colour | None
    tolerance: float

    @property
    def success(self) -> bool | None:
        """Whether the agent did it; None where there are two goals and nothing says which was meant."""
        goals = [self.shown] if self.shown else list(self.distances)
        return self.distances[goals[0]] < self.tolerance if len(goals) == 1 else None

    def __str__(self) -> str:
        told = " and ".join(
            f"{100 * metres:.1f} cm from the {colour} goal" for colour, metres in self.distances.items()
        )
        verdict = {True: "success", False: "no success", None: "the clip says which was meant"}[self.success]
        return f"{told}: {verdict}" + (f" ({self.shown} was shown)" if self.shown else "")


def prepare(
    clip: str, model: str | None, context: int | None, seed: int, episodes: int, output: Path
) -> Task:
    """Check everything before the work starts. Raises AnyviewError if anything of it does not fit."""
    study = load_params()
    if output.exists() and not (output / VIDEO).is_file():
        raise AnyviewError(f"{output}: it exists and is no earlier result; name another folder by --output")
    if episodes < (warmup := study.imitation.ddpg.warmup_episodes):
        raise AnyviewError(f"--episodes {episodes}: DDPG learns nothing in fewer than {warmup}")
    stored = find_clip(clip)
    if model is None:
        folder = _fitting_model(study, stored.dataset if stored else study.imitation.dataset)
    else:
        folder = find_model(model)
    meta = read_meta(folder)
    if (dataset := meta.get("dataset")) not in study.demonstration_sets:
        sets = ", ".join(study.demonstration_sets)
        raise AnyviewError(f"{folder}: not for the simulated agent's view; train it on one of {sets}")
    if stored and "experts" in meta:
        frames = resize(read_stored(paths.clip_set(stored.dataset), clip)[0], meta["image_size"])
    else:
        frames, _ = read_clip(clip, meta["image_size"])
    if len(frames) < FRAMES:
        raise AnyviewError(f"{clip}: {len(frames)} frames, fewer than the {FRAMES} of an episode")
    params = _one_run(study, folder, str(dataset), meta["image_size"], seed, episodes)
    if context is None:
        scene = draw_contexts(params, _NAME, 1)[0]
    elif context < study.imitation.runs:
        of_the_study = params.model_copy(update={"base": study.base})
        scene = draw_contexts(of_the_study, "evaluation", study.imitation.runs)[context]
    else:
        raise AnyviewError(f"--context {context}: there are contexts 0 to {study.imitation.runs - 1}")
    chosen = stored.choice if stored and scene.choice else None
    shown = next((colour for colour in COLOURS if colour == chosen), None)
    if "experts" in meta:
        in_step = frames_in_step(seconds_of(len(frames)))
    else:
        in_step = np.linspace(0, len(frames) - 1, FRAMES).round().astype(int)
    return Task(params, folder, frames[in_step], scene.choosing(shown) if shown else scene, shown)


def train(task: Task, output: Path) -> Outcome:
    """Train one policy and write ``output``; continues from its checkpoints.

    - ``policy-0.safetensors`` and ``policy.json``: see ``learners.common.policies``;
    - ``curve.csv``: the learning curve;
    - ``rollout.mp4``: the clip, its translation, and the agent, side by side.
    """
    params, context = task.params, task.context
    digest = hashlib.sha256(task.clip.tobytes()).hexdigest()
    scratch = checkpoint_folder(
        [params.model_dump(include={"base", "sim", "imitation"}), context.to_json(), digest],
        [file for file in task.model.iterdir() if file.is_file()],
    )
    method = Method(ddpg.make_learner, make_reward)
    result = evaluate_group(Work(_NAME, params, method, [0], [context], task.clip[None]), scratch)
    agent, translated = np.split(result.rollouts[0], 2, axis=2)
    views = np.concatenate([task.clip, translated, agent], axis=2)
    scale = -(-_WIDTH // task.clip.shape[2])
    with whole_folder(output) as folder:
        save_policies(folder, result.policies, [context], "ddpg", params.sim.control, params.sim.image_size)
        write_atomically(folder / "curve.csv", result.curve.to_csv(index=False))
        write_video(folder / VIDEO, views.repeat(scale, axis=1).repeat(scale, axis=2), RATE, "AV1")
    shutil.rmtree(scratch)
    ended, tolerance = result.runs.iloc[0], load_task(context.task).tolerance
    if context.choice is None:
        return Outcome({COLOURS[0]: float(ended["final_distance"])}, None, tolerance)
    counted = context.choice.colour
    names = {True: "final_distance", False: "other_distance"}
    return Outcome({each: float(ended[names[each == counted]]) for each in COLOURS}, task.shown, tolerance)


def _fitting_model(params: Params, dataset: str) -> Path:
    """The translator of clips of ``dataset`` with every loss, the one with a task embedding first.

    Before these comes one for which ``dataset`` is that of other experts.
    """
    cells = {
        name: cell
        for name, cell in params.translator_cells.items()
        if (cell.other_experts or cell.dataset) == dataset and _has_every_loss(cell.weights)
    }
    trained = [name for name in cells if (paths.model(name) / "model.json").is_file()]
    if not trained:
        listed = ", ".join(cells) or "none of params.yaml"
        raise AnyviewError(
            f"{paths.DATA / 'models'}: no translator of {dataset} clips is trained yet ({listed}); "
            "run `dvc repro`, or name one by --model"
        )
    return paths.model(
        max(trained, key=lambda name: (bool(cells[name].other_experts), cells[name].task_embedding))
    )


def _has_every_loss(weights: LossWeights) -> bool:
    """Keypoints that are taught need no L_rec: it falls to nothing without a better translation."""
    encoding = max(weights.reconstruction, weights.places)
    return min(weights.translation, encoding, weights.alignment) > 0


def _one_run(params: Params, model: Path, dataset: str, size: int, seed: int, episodes: int) -> Params:
    """``params`` with one method, rewarded as `ours` is; ``size`` is the model's, in pixels."""
    cell = DemonstrationCell(
        learner="ddpg",
        reward="translated",
        model=str(model.absolute()),  # `paths.model` of an absolute path is that path
        weights=RewardWeights(feature=1.0, image=1.0),
        time_power=0.0,
    )
    changed = {
        "dataset": dataset,
        "iterations": episodes,
        "episodes_per_iteration": 1,
        "cells": {_NAME: cell},
    }
    return params.model_copy(
        update={
            "base": params.base.model_copy(update={"seed": seed}),
            "sim": params.sim.model_copy(update={"image_size": size}),
            "imitation": params.imitation.model_copy(update=changed),
        }
    )
