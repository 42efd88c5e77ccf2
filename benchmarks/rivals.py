"""Learners and renderers that are known to be fast, beside ours, per second of one processor.

- Environment steps, updates included: ours in lockstep, DDPG of Stable-Baselines3 and of SBX, which train
  one run. All have the same environment, network, batch and number of updates, once with pictures and the
  translated reward, once with neither: then the reward is the negative distance. Compiling is not counted.
- Pictures of 64x64 pixels: ours, and EnvPool's of Gymnasium's Pusher, another arm that pushes something on a
  table, each beside `mujoco.Renderer` on its own scene, shadows and multisampling off in all.

The translator has random weights: its speed is that of a trained one. Rivals that are not installed are left
out: `pip install sbx-rl envpool`, best in an environment of their own.

Usage: python benchmarks/rivals.py [learners | renderers]
"""

import ctypes
import importlib
import importlib.util
import os
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

# One thread for every library, JAX and Mesa included; before they are imported.
os.environ |= {"OMP_NUM_THREADS": "1", "NPROC": "1", "LP_NUM_THREADS": "0", "JAX_PLATFORMS": "cpu"}
os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false"

import gymnasium
import numpy as np
import torch
from lockstep import comparable_params, make_clips, make_translator
from simulation import expert_frames, plain_frames

from anyview.config import Params
from anyview.environments.pusher import PusherEnv
from anyview.environments.translated import TranslatedReward
from anyview.evaluation.runs import explore
from anyview.learners.common.interfaces import Arrays, RewardSource
from anyview.learners.ddpg import make_learner
from anyview.pusher.batch import ACTIONS, PusherBatch, observation_size
from anyview.pusher.contexts import Context, sample_contexts
from anyview.rewards.demonstration import DemonstrationReward, translate_demonstrations

import mujoco  # isort: skip  (after anyview.pusher, which chooses the OpenGL backend)

RUNS, EPISODES, ROUNDS, SIZE = 8, 4, 3, 64
PUSHER = "mujoco/assets_gym/pusher_v5_envpool.xml"
Train = Callable[[], int]
"""Train for EPISODES more episodes a run; the environment steps of all runs together."""
STEPS = (ROUNDS + 1) * EPISODES * ACTIONS  # of a run: no learner pays for a larger replay buffer


class Blind(PusherBatch):
    """Arms without a camera."""

    def render(self) -> np.ndarray:
        return np.empty((self.count, 0))


class Distance:
    """The negative distance to the goal, as a reward."""

    def __init__(self, batch: PusherBatch) -> None:
        self._batch = batch

    def step(self, frames: np.ndarray, step: int) -> np.ndarray:
        return -self._batch.distance()[:, None]

    def end_iteration(self) -> Arrays:
        return {}

    def state(self) -> Arrays:
        return {}

    def restore(self, state: Arrays) -> None:
        pass


def make_batch(params: Params, contexts: Sequence[Context], sees: bool) -> tuple[PusherBatch, RewardSource]:
    """The environment of a group of runs, and its reward."""
    if not sees:
        blind = Blind(contexts)
        return blind, Distance(blind)
    cell, model, clips = params.imitation.cells["ours"], make_translator(params), make_clips(params, contexts)
    first = clips[:, 0].copy()
    reward = DemonstrationReward(
        model, *translate_demonstrations(model, clips[:2], first), first, cell.weights, cell.time_power
    )
    return PusherBatch(contexts, image_size=params.sim.image_size), reward


def make_env(params: Params, context: Context, sees: bool) -> gymnasium.Env:
    """The environment of one run, for learners that train one at a time."""
    if not sees:
        return PusherEnv(context)
    env = PusherEnv(context, image_size=params.sim.image_size, render_mode="rgb_array")
    cell, clips = params.imitation.cells["ours"], make_clips(params, [context, context])
    return TranslatedReward(env, make_translator(params), clips, cell.weights, cell.time_power)


def ours(params: Params, contexts: Sequence[Context], sees: bool) -> Train:
    """A group in lockstep."""
    batch, reward = make_batch(params, contexts, sees)
    learner = make_learner(params, range(len(contexts)), observation_size("push", 1))

    def train() -> int:
        for _ in range(EPISODES):
            explore(batch, learner, reward, len(contexts))
            learner.end_iteration()
        return EPISODES * ACTIONS * len(contexts)

    return train


def stable_baselines3(params: Params, contexts: Sequence[Context], sees: bool) -> Train:
    """One run of Stable-Baselines3's DDPG."""
    return _stable(importlib.import_module("stable_baselines3").DDPG, params, contexts[0], sees)


def sbx(params: Params, contexts: Sequence[Context], sees: bool) -> Train:
    """One run of SBX's DDPG."""
    return _stable(importlib.import_module("sbx").DDPG, params, contexts[0], sees)


def _stable(learner: Any, params: Params, context: Context, sees: bool) -> Train:
    ddpg = params.imitation.ddpg
    model = learner(
        "MlpPolicy",
        make_env(params, context, sees),
        batch_size=ddpg.batch_size,
        gradient_steps=round(ddpg.updates_per_step),
        train_freq=1,
        learning_starts=ACTIONS - 1,
        buffer_size=STEPS,
        policy_kwargs={"net_arch": list(ddpg.hidden)},
    )

    def train() -> int:
        model.learn(EPISODES * ACTIONS, reset_num_timesteps=False)
        return EPISODES * ACTIONS

    return train


def compare_learners() -> None:
    """Print steps per second of every learner, and how many times as fast ours is."""
    params = comparable_params()
    contexts, _ = sample_contexts(np.random.default_rng(0), RUNS)
    makers = {"ours": ours} | {make.__name__: make for make in (stable_baselines3, sbx)}
    makers = {name: make for name, make in makers.items() if name == "ours" or installed(name)}
    for sees in (True, False):
        print("with pictures and the translated reward:" if sees else "without:")
        trains = [make(params, contexts, sees) for make in makers.values()]
        rates = np.array([[rate(train) for train in trains] for _ in range(ROUNDS + 1)])[1:]
        for name, theirs in zip(makers, rates.T, strict=True):
            show(name, theirs, rates[:, 0] / theirs, "steps/s; ours / theirs")


def rate(work: Callable[[], int]) -> float:
    """How many things ``work`` does in a second of the processor."""
    started = time.process_time()
    return work() / (time.process_time() - started)


def compare_renderers() -> None:
    """Print pictures per second of ours and of EnvPool, each as a multiple of `mujoco.Renderer`'s there."""
    contexts, _ = sample_contexts(np.random.default_rng(0), RUNS)
    pairs = {"ours": (expert_frames(contexts), plain_frames(contexts))}
    if installed("envpool"):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            write_pusher(folder)
            pairs["envpool"] = (envpool_frames(folder), plain_pusher_frames(folder))
    for name, (fast, slow) in pairs.items():
        rates = np.array([[rate(fast), rate(slow)] for _ in range(ROUNDS + 1)])[1:]
        show(name, rates[:, 0], rates[:, 0] / rates[:, 1], "pictures/s; / mujoco.Renderer's")


def write_pusher(folder: Path) -> None:
    """The scene of EnvPool's pusher into ``folder``, without shadows and multisampling, as ours is."""
    import envpool_assets

    text = (Path(envpool_assets.__file__).parent / PUSHER).read_text()
    quality = '<visual><quality shadowsize="0" offsamples="0"/></visual><worldbody>'
    (folder / PUSHER).parent.mkdir(parents=True)
    (folder / PUSHER).write_text(text.replace("<worldbody>", quality))


def envpool_frames(folder: Path) -> Callable[[], int]:
    """A picture of every environment of EnvPool's batch, whose scene is in ``folder``."""
    # Its wheel brings an EGL library under a name by which the MuJoCo in it does not find it.
    ctypes.CDLL("libEGL.so.1", ctypes.RTLD_GLOBAL)
    import envpool

    options: dict[str, Any] = {"render_width": SIZE, "render_height": SIZE, "render_mode": "rgb_array"}
    env = envpool.make(
        "Pusher-v5", "gymnasium", num_envs=RUNS, num_threads=1, base_path=str(folder), **options
    )
    env.reset()

    def work() -> int:
        for _ in range(4):
            env.render(list(range(RUNS)))
        return 4 * RUNS

    return work


def plain_pusher_frames(folder: Path) -> Callable[[], int]:
    """As many by `mujoco.Renderer`."""
    scene = mujoco.MjModel.from_xml_path(str(folder / PUSHER))
    data, shoot = mujoco.MjData(scene), mujoco.Renderer(scene, SIZE, SIZE)

    def work() -> int:
        for _ in range(4 * RUNS):
            mujoco.mj_forward(scene, data)
            shoot.update_scene(data)
            shoot.render()
        return 4 * RUNS

    return work


def installed(package: str) -> bool:
    """Whether it is there; says so where it is not."""
    found = importlib.util.find_spec(package) is not None
    if not found:
        print(f"{package}: not installed, left out")
    return found


def show(name: str, rates: np.ndarray, ratios: np.ndarray, unit: str) -> None:
    """Print medians over the rounds, and the range of the ratios."""
    print(
        f"  {name:18} {np.median(rates):7.0f} {unit}: {np.median(ratios):.2f} "
        f"(from {ratios.min():.2f} to {ratios.max():.2f})"
    )


def main(wanted: list[str]) -> None:
    """Print the comparisons."""
    torch.set_num_threads(1)
    for name, compare in {"learners": compare_learners, "renderers": compare_renderers}.items():
        if not wanted or name in wanted:
            compare()


if __name__ == "__main__":
    main(sys.argv[1:])
