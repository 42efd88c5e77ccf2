"""Time to quality: minutes from nothing until `ours` brings the object within 2 cm, then 1 cm, of the goal.

- from nothing: the stages `simulate`, `split` and `train` in an empty folder, then the learner in lockstep;
- quality: the final distance without noise, the median over contexts of the stream "tuning", never the
  evaluation's. A bound is reached when three tests in succession are within it in their mean: one alone may
  be luck. Tests are every fifth episode, and their time is not counted;
- beside it Stable-Baselines3's DDPG and SAC, in the same contexts, with the same translator, reward, network,
  batches, discount, updates a step and environment steps. Their runs follow one after another on each worker,
  so the time of k steps is that of all runs' k steps, divided by the workers.

Any key of params.yaml can be set, as for `dvc exp run`. Run it on an idle machine.

Usage: python benchmarks/quality.py [-S KEY=VALUE ...] [--contexts 16] [--rivals ddpg sac]
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from dvc.exceptions import DvcException
from dvc.utils.hydra import apply_overrides

from anyview import paths
from anyview.config import Params, load_params
from anyview.environments.pusher import PusherEnv
from anyview.environments.translated import TranslatedReward
from anyview.evaluation.demonstrations import imitated_demonstrations
from anyview.evaluation.runs import explore, groups_of
from anyview.learners.ddpg import make_learner
from anyview.pusher.batch import ACTION_SIZE, ACTIONS, PusherBatch, observation_size
from anyview.pusher.contexts import Context, sample_contexts
from anyview.pusher.episodes import episode
from anyview.rewards.demonstration import DemonstrationReward, translate_demonstrations
from anyview.runtime.device import torch_device, use_threads, worker_count
from anyview.runtime.errors import AnyviewError, exit_code
from anyview.runtime.workers import run_tasks
from anyview.seeds import stream
from anyview.translator.weights import load_translator

ROOT = Path(__file__).parents[1]
CELL = "ours"
BOUNDS = (0.02, 0.01)  # metres
EVERY, MEAN_OF = 5, 3  # episodes between tests; tests in succession that are averaged
RIVALS = ("ddpg", "sac")


class Tests:
    """Final distances (R,) of R runs at test after test, and when: seconds of training since ``began``."""

    def __init__(self, began: float):
        self._began, self._paused = began, 0.0
        self.seconds: list[float] = []
        self.distances: list[np.ndarray] = []

    def add(self, pushers: PusherBatch, act: Any) -> None:
        """Test ``act``, from observations (R, O) to actions (R, 3), without counting the time."""
        started = time.monotonic()
        self.seconds.append(started - self._began - self._paused)
        for _ in episode(pushers, lambda now: act(now.observations)):
            pass
        self.distances.append(pushers.distance())
        self._paused += time.monotonic() - started


def lockstep(
    params: Params, runs: range, contexts: list[Context], clips: np.ndarray, began: float
) -> tuple[list[float], list[np.ndarray]]:
    """Train ``runs`` in lockstep, imitating ``clips``: seconds since ``began`` and distances, by test."""
    use_threads(1)
    cell = params.imitation.cells[CELL]
    model = load_translator(paths.model(cell.model)).to(torch_device())
    control, size, copies = params.sim.control, params.sim.image_size, params.imitation.episodes_per_iteration
    acting = PusherBatch([context for context in contexts for _ in range(copies)], control, size)
    testing = PusherBatch(contexts, control, size)
    testing.reset()
    first = testing.render()
    targets = translate_demonstrations(model, clips, first)
    reward = DemonstrationReward(model, *targets, first, cell.weights, cell.time_power)
    learner = make_learner(params, runs, observation_size(contexts[0].task, len(contexts[0].goals)))
    tests = Tests(began)
    for iteration in range(1, params.imitation.iterations + 1):
        explore(acting, learner, reward, len(runs))
        learner.end_iteration()
        if iteration % EVERY == 0:
            tests.add(testing, lambda seen: learner.act(seen[:, None], explore=False)[:, 0])
    return tests.seconds, tests.distances


def rival(
    name: str, params: Params, run: int, context: Context, clips: np.ndarray
) -> tuple[list[float], list[np.ndarray]]:
    """Train Stable-Baselines3's ``name`` in one context; seconds and distances (1,), test by test."""
    from stable_baselines3 import DDPG, SAC
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.noise import NormalActionNoise

    use_threads(1)
    tests = Tests(time.monotonic())
    cell, wanted, size = params.imitation.cells[CELL], params.imitation.ddpg, params.sim.image_size
    control, testing = params.sim.control, PusherBatch([context], params.sim.control, size)

    class Test(BaseCallback):
        def _on_step(self) -> bool:
            if self.n_calls % (EVERY * ACTIONS) == 0:
                tests.add(testing, lambda seen: self.model.predict(seen, deterministic=True)[0])
            return True

    pusher = PusherEnv(context, control=control, image_size=size, render_mode="rgb_array")
    model = load_translator(paths.model(cell.model))
    env = TranslatedReward(pusher, model, clips, cell.weights, cell.time_power)
    settings: dict[str, Any] = {
        "batch_size": wanted.batch_size,
        "gamma": wanted.discount,
        "gradient_steps": round(wanted.updates_per_step),
        "train_freq": 1,
        "learning_starts": ACTIONS,
        "policy_kwargs": {"net_arch": list(wanted.hidden)},
        "seed": run,
        "device": "cpu",
    }
    if name == "ddpg":
        noise = NormalActionNoise(np.zeros(ACTION_SIZE), np.full(ACTION_SIZE, wanted.noise))
        learner: Any = DDPG("MlpPolicy", env, action_noise=noise, tau=wanted.target_rate, **settings)
    else:
        learner = SAC("MlpPolicy", env, **settings)
    learner.learn(params.imitation.iterations * params.imitation.episodes_per_iteration * ACTIONS, Test())
    return tests.seconds, tests.distances


def make_model(folder: Path, changes: list[str]) -> dict[str, float]:
    """Simulate, split and train in ``folder`` by params.yaml with ``changes``: seconds by stage."""
    params = folder / "params.yaml"
    shutil.copy(ROOT / "params.yaml", params)
    try:
        apply_overrides(params, changes)
    except DvcException as error:
        raise AnyviewError(f"-S: {str(error.__cause__ or error).splitlines()[0]}") from error
    imitation = load_params(params).imitation
    dataset, cell = imitation.dataset, imitation.cells[CELL]
    seconds = {}
    for stage, argument in (("simulate", dataset), ("split", dataset), ("train", cell.model)):
        started = time.monotonic()
        subprocess.run([sys.executable, ROOT / "stages" / f"{stage}.py", argument], cwd=folder, check=True)
        seconds[stage] = time.monotonic() - started
    return seconds


def report(name: str, before: float, seconds: np.ndarray, distances: np.ndarray) -> None:
    """Print the minutes to each bound, ``before`` included; ``seconds`` (P,), ``distances`` (P, R)."""
    medians = np.convolve(np.median(distances, axis=1), np.full(MEAN_OF, 1 / MEAN_OF), "valid")
    fields = []
    for bound in BOUNDS:
        reached = np.flatnonzero(medians <= bound)
        if len(reached):
            at = reached[0] + MEAN_OF - 1
            fields.append(f"{(before + seconds[at]) / 60:.1f} min ({EVERY * (at + 1)} episodes)")
        else:
            fields.append("not reached")
    spent = f"{(before + seconds[-1]) / 60:.1f} min"
    print(f"{name:24} {fields[0]:>24} {fields[1]:>24} {100 * medians[-1]:7.1f} cm after {spent}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-S", dest="changes", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--contexts", type=int, default=16)
    parser.add_argument("--rivals", nargs="*", choices=RIVALS, default=list(RIVALS))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as made:
        os.environ["ANYVIEW_SCRATCH"] = str(Path(made) / "scratch")
        folder = Path(made) / "study"
        folder.mkdir()
        stages = make_model(folder, options.changes)
        os.chdir(folder)
        params = load_params()
        contexts, _ = sample_contexts(stream(params.base.seed, "tuning"), options.contexts)
        clips = imitated_demonstrations(params).frames
        groups = groups_of(len(contexts), params.imitation.group)
        began = time.monotonic()
        tasks = [(params, group, [contexts[run] for run in group], clips, began) for group in groups]
        parts = list(run_tasks(lockstep, tasks))
        before, took = sum(stages.values()), max(seconds[-1] for seconds, _ in parts)
        print(", ".join(f"{stage} {spent:.0f} s" for stage, spent in (stages | {"imitate": took}).items()))
        print(f"{'':24} {'2 cm':>24} {'1 cm':>24}  at the end (medians of {len(contexts)} contexts)")
        seconds = np.max([seconds for seconds, _ in parts], axis=0)
        report(CELL, before, seconds, np.hstack([np.array(distances) for _, distances in parts]))
        for name in options.rivals:
            alone = [(name, params, run, context, clips) for run, context in enumerate(contexts)]
            parts = list(run_tasks(rival, alone))
            seconds = np.sum([seconds for seconds, _ in parts], axis=0) / min(worker_count(), len(contexts))
            distances = np.hstack([np.array(distances) for _, distances in parts])
            report(f"{name} (Stable-Baselines3)", before, seconds, distances)


if __name__ == "__main__":
    torch.set_num_threads(1)
    sys.exit(exit_code(main))
