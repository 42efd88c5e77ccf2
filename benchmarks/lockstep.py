"""Where the time of a lockstep step of DDPG goes: one core, a group of 8 runs, each part beside its floor.

Acting, encoder and updates: their matrix products at the rate of a large one. Physics: MuJoCo's steps alone.
Rendering: a picture of nothing (clear, read back, average). Replay: its bytes at the rate of a large copy.
`rivals.py` compares the whole with learners of others.

The translator has random weights: its speed is that of a trained one. Run it on an idle machine.

Usage: python benchmarks/lockstep.py
"""

import time
from collections.abc import Callable
from contextlib import contextmanager
from itertools import pairwise

import cv2
import numpy as np
import torch

from anyview.config import Params, load_params
from anyview.learners.common.replay import Replay
from anyview.learners.ddpg import make_learner, minibatch_ages
from anyview.pusher.batch import ACTION_SIZE, ACTIONS, PusherBatch, observation_size
from anyview.pusher.contexts import Context, sample_contexts
from anyview.pusher.expert import roll_out
from anyview.pusher.render import renderer
from anyview.pusher.scene import SUBSTEPS
from anyview.pusher.task import load_task
from anyview.rewards.demonstration import DemonstrationReward, translate_demonstrations
from anyview.translator.network import ContextTranslator

import mujoco.batch  # isort: skip  (after anyview.pusher, which chooses the OpenGL backend)

RUNS, EPISODES = 8, 4


def comparable_params() -> Params:
    """The params, without what DDPG of others lacks, and with updates from the second episode on."""
    params = load_params()
    ddpg = params.imitation.ddpg.model_copy(update={"time_features": 0, "warmup_episodes": 1})
    return params.model_copy(update={"imitation": params.imitation.model_copy(update={"ddpg": ddpg})})


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
    """Least seconds of each part of a lockstep step, as the module's text defines them."""
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
    pushers = mujoco.batch.Batch(load_task("push").model("twist"), nsim=RUNS, nthread=1)
    picture = empty_picture(2 * size)
    # Per update, in passes: targets 2, critic 3 (its backward counts 2), policy 3 and through the critic 2.
    return {
        "acting": RUNS * network / rate,
        "physics": seconds(lambda: pushers.step(nstep=SUBSTEPS)),
        "rendering": RUNS * seconds(picture, 200),
        "reward (encoder)": RUNS * encoder / rate,
        "replay": RUNS * ddpg.updates_per_step * ddpg.batch_size * row / copying,
        "updates": RUNS * ddpg.updates_per_step * 10 * ddpg.batch_size * network / rate,
    }


def main() -> None:
    """Print the breakdown."""
    params = comparable_params()
    contexts, _ = sample_contexts(np.random.default_rng(0), RUNS)
    steps, watch = train_group(params, range(RUNS), contexts)
    lowest, whole = floors(params), sum(watch.parts.values())
    print(f"a lockstep step of {RUNS} runs on one core:")
    for name, spent in sorted(watch.parts.items(), key=lambda part: -part[1]):
        taken = f"{1000 * RUNS * spent / steps:6.2f} ms {spent / whole:4.0%}"
        print(f"  {name:20} {taken}, floor {1000 * lowest[name]:.3f} ms")


if __name__ == "__main__":
    main()
