"""Training in lockstep against Stable-Baselines3's DDPG, and where the time of a lockstep step goes.

- environment steps per second, updates included, summed over 15 runs: ours in two groups on two cores,
  against Stable-Baselines3 training runs one after another, with one thread or all, whichever is faster. Both
  have the same environment, translated reward, network, batch and number of updates;
- one core's time in a lockstep step of a group of 8, each part beside its floor: acting, encoder and updates,
  their matrix products at the rate of a large one; physics, MuJoCo's steps alone; rendering, a picture of
  nothing (clear, read back, average); replay, its bytes at the rate of a large copy.

The translator has random weights: its speed is that of a trained one. Run it on an idle machine.

Usage: python benchmarks/lockstep.py
"""

import os
import time
from collections.abc import Callable
from contextlib import contextmanager
from itertools import pairwise

import cv2
import numpy as np
import torch

from anyview.config import Params, load_params
from anyview.environments.pusher import PusherEnv
from anyview.environments.translated import TranslatedReward
from anyview.evaluation.runs import groups_of
from anyview.learners.common.replay import Replay
from anyview.learners.ddpg import make_learner, minibatch_ages
from anyview.pusher.batch import ACTION_SIZE, ACTIONS, PusherBatch, observation_size
from anyview.pusher.contexts import Context, sample_contexts
from anyview.pusher.expert import roll_out
from anyview.pusher.render import renderer
from anyview.pusher.scene import SUBSTEPS
from anyview.pusher.task import load_task
from anyview.rewards.demonstration import DemonstrationReward, translate_demonstrations
from anyview.runtime.workers import run_tasks
from anyview.translator.network import ContextTranslator

import mujoco.batch  # isort: skip  (after anyview.pusher, which chooses the OpenGL backend)

RUNS, EPISODES, ROUNDS = 15, 4, 3


def make_translator(params: Params) -> ContextTranslator:
    """A compact translator with random weights."""
    torch.manual_seed(0)
    return ContextTranslator("compact", params.sim.image_size).eval().requires_grad_(False)


def make_clips(params: Params, contexts: list[Context]) -> np.ndarray:
    """The expert in ``contexts``, (N, 50, H, W, 3)."""
    camera, (positions, _) = renderer("push", params.sim.image_size), roll_out(contexts)
    return np.stack([camera.render_clip(*each) for each in zip(contexts, positions, strict=True)])


class Stopwatch:
    """Seconds by part."""

    def __init__(self) -> None:
        self.parts: dict[str, float] = {}

    @contextmanager
    def part(self, name: str):
        """Count for ``name``."""
        started = time.perf_counter()
        yield
        self.parts[name] = self.parts.get(name, 0.0) + time.perf_counter() - started


def train_group(params: Params, runs: range, contexts: list[Context]) -> tuple[int, Stopwatch]:
    """Train ``runs`` in lockstep for EPISODES episodes after one to warm up: steps, and seconds by part."""
    torch.set_num_threads(1)
    clips = make_clips(params, contexts)
    cell = params.imitation.cells["ours"]
    learner, model, first = (
        make_learner(params, runs, observation_size("push", 1)),
        make_translator(params),
        clips[:, 0].copy(),
    )
    targets = translate_demonstrations(model, clips[:2], first)
    reward = DemonstrationReward(model, *targets, first, cell.weights, cell.time_power)
    pushers, watch = PusherBatch(contexts, image_size=params.sim.image_size), Stopwatch()
    for episode in range(EPISODES + 1):
        if episode == 1:
            watch.parts.clear()
        observations = pushers.reset()[:, None]
        for step in range(1, ACTIONS + 1):
            with watch.part("acting"):
                actions = learner.act(observations, explore=True)
            with watch.part("physics"):
                next_observations = pushers.step(actions[:, 0])[:, None]
            with watch.part("rendering"):
                frames = pushers.render()
            with watch.part("reward (encoder)"):
                rewards = reward.step(frames[:, None], step)
            with watch.part("updates"):
                learner.record(observations, actions, rewards, next_observations, step)
            observations = next_observations
        with watch.part("updates"):
            learner.end_iteration()
    replaying = EPISODES * replay_seconds(params, len(runs))
    watch.parts |= {"replay": replaying, "updates": watch.parts["updates"] - replaying}
    return EPISODES * ACTIONS * len(runs), watch


def replay_seconds(params: Params, runs: int) -> float:
    """Seconds that the replay of ``runs`` takes for an episode: drawing, gathering and storing."""
    ddpg = params.imitation.ddpg
    width, updates = 2 * observation_size("push", 1) + ACTION_SIZE + 2, round(ddpg.updates_per_step * ACTIONS)
    replay, rows = Replay(runs, ddpg.replay, width, torch.device("cpu")), torch.zeros(runs, ACTIONS, width)
    rng = np.random.default_rng(0)

    def replay_episode() -> None:
        replay.add(rows)
        drawn = [minibatch_ages(rng, updates, ddpg.batch_size, replay.size, replay.size) for _ in range(runs)]
        for ages in torch.from_numpy(np.stack(drawn, axis=1)):
            replay.take(ages)

    return seconds(replay_episode, 5)


def lockstep_rate(params: Params, contexts: list[Context]) -> float:
    """Steps per second of 15 runs in groups on two workers, setting up left out."""
    os.environ["ANYVIEW_WORKERS"] = "2"
    groups = groups_of(len(contexts), params.imitation.group)
    tasks = [(params, group, [contexts[run] for run in group]) for group in groups]
    return sum(steps / sum(watch.parts.values()) for steps, watch in run_tasks(train_group, tasks))


def stable_baselines3_rate(params: Params, contexts: list[Context], threads: int) -> float:
    """Steps per second of Stable-Baselines3's DDPG in one run: the rate of any number one after another."""
    from stable_baselines3 import DDPG

    torch.set_num_threads(threads)
    clips = make_clips(params, contexts[:2])
    pusher = PusherEnv(contexts[0], image_size=params.sim.image_size, render_mode="rgb_array")
    cell = params.imitation.cells["ours"]
    env = TranslatedReward(pusher, make_translator(params), clips, cell.weights, cell.time_power)
    wanted = params.imitation.ddpg
    model = DDPG(
        "MlpPolicy",
        env,
        batch_size=wanted.batch_size,
        gradient_steps=round(wanted.updates_per_step),
        train_freq=1,
        learning_starts=ACTIONS - 1,
        policy_kwargs={"net_arch": list(wanted.hidden)},
    )
    model.learn(ACTIONS)
    started = time.perf_counter()
    model.learn(EPISODES * ACTIONS, reset_num_timesteps=False)
    return EPISODES * ACTIONS / (time.perf_counter() - started)


def seconds(work: Callable[[], object], repeats: int = 30) -> float:
    """Median time of ``work``."""
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return float(np.median(times))


def empty_picture(size: int) -> Callable[[], object]:
    """Draw a picture of nothing as the renderer draws one: clear, read back, average."""
    nothing = mujoco.MjModel.from_xml_string("<mujoco/>")
    pixels = np.empty((size, size, 3), np.uint8)
    surface = mujoco.GLContext(size, size)
    surface.make_current()
    nothing.vis.global_.offwidth = nothing.vis.global_.offheight = size
    context = mujoco.MjrContext(nothing, mujoco.mjtFontScale.mjFONTSCALE_100)
    mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, context)
    scene, rect = mujoco.MjvScene(nothing, maxgeom=1), mujoco.MjrRect(0, 0, size, size)
    for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_SKYBOX):
        scene.flags[flag] = 0

    def draw() -> None:
        surface.make_current()
        mujoco.mjr_render(rect, scene, context)
        mujoco.mjr_readPixels(pixels, None, rect, context)
        cv2.resize(pixels[::-1], (size // 2, size // 2), interpolation=cv2.INTER_AREA)

    return draw


def floors(params: Params) -> dict[str, float]:
    """Least seconds of each part of a lockstep step of 8 runs, as the module's text defines them."""
    torch.set_num_threads(1)
    square, memory = torch.randn(512, 512), torch.zeros(1 << 24)
    rate = 2 * 512**3 / seconds(lambda: square @ square)
    copying = 4 * len(memory) / seconds(memory.clone)
    size, channels = params.sim.image_size, (3, 16, 32, 64, 128)
    encoder = sum(
        2 * 25 * before * after * (size >> (layer + 1)) ** 2
        for layer, (before, after) in enumerate(pairwise(channels))
    )
    ddpg = params.imitation.ddpg
    widths = [observation_size("push", 1) + ACTION_SIZE + ddpg.time_features, *ddpg.hidden, 1]
    network = 2 * sum(a * b for a, b in pairwise(widths))
    row = 4 * (2 * observation_size("push", 1) + ACTION_SIZE + 2)
    pushers = mujoco.batch.Batch(load_task("push").model("twist"), nsim=8, nthread=1)
    picture = empty_picture(2 * size)
    # Per update, in passes: targets 2, critic 3 (its backward counts 2), policy 3 and through the critic 2.
    return {
        "acting": 8 * network / rate,
        "physics": seconds(lambda: pushers.step(nstep=SUBSTEPS)),
        "rendering": 8 * seconds(picture, 200),
        "reward (encoder)": 8 * encoder / rate,
        "replay": 8 * ddpg.updates_per_step * ddpg.batch_size * row / copying,
        "updates": 8 * ddpg.updates_per_step * 10 * ddpg.batch_size * network / rate,
    }


def main() -> None:
    """Print the comparison and the breakdown."""
    params, cores = load_params(), len(os.sched_getaffinity(0))
    ddpg = params.imitation.ddpg.model_copy(update={"time_features": 0, "warmup_episodes": 1})
    imitation = params.imitation.model_copy(update={"ddpg": ddpg, "episodes_per_iteration": 1})
    params = params.model_copy(update={"imitation": imitation})
    contexts, _ = sample_contexts(np.random.default_rng(0), RUNS)
    pairs = []
    for _ in range(ROUNDS):
        theirs = [stable_baselines3_rate(params, contexts, threads) for threads in {1, cores}]
        pairs.append((lockstep_rate(params, contexts), max(theirs)))
    ours_rate, theirs_rate = np.median(pairs, axis=0)
    ratios = [a / b for a, b in pairs]
    print(
        f"{RUNS} runs, {ddpg.updates_per_step:.0f} updates a step of batch {ddpg.batch_size}, "
        f"{ddpg.hidden} units: lockstep {ours_rate:.0f} steps/s,\n"
        f"Stable-Baselines3 {theirs_rate:.0f} steps/s: ratio {np.median(ratios):.1f} "
        f"(from {min(ratios):.1f} to {max(ratios):.1f} over {ROUNDS} rounds)\n"
    )
    steps, watch = train_group(params, range(8), contexts[:8])
    lowest, whole = floors(params), sum(watch.parts.values())
    print("a lockstep step of 8 runs on one core:")
    for name, spent in sorted(watch.parts.items(), key=lambda part: -part[1]):
        taken = f"{1000 * 8 * spent / steps:6.2f} ms {spent / whole:4.0%}"
        print(f"  {name:20} {taken}, floor {1000 * lowest[name]:.3f} ms")


if __name__ == "__main__":
    main()
