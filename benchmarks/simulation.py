"""Rendering and physics, each against the plain way on the same scene, side by side in one run.

- frames per second of ``anyview.pusher.render`` against ``mujoco.Renderer`` at its default quality, shadows
  and multisampling off in both; ours renders at twice the size and averages, the plain one does not;
- control steps per second of 15 pushers on ``mujoco.batch`` against a loop of ``mujoco.mj_step``;
- every other task against push: what a step of the expert costs in lockstep, and what a frame costs.

Usage: python benchmarks/simulation.py
"""

import copy
import time
from collections.abc import Callable, Sequence

import numpy as np

from anyview.pusher.batch import ACTIONS, PusherBatch
from anyview.pusher.contexts import Context, sample_contexts
from anyview.pusher.expert import roll_out
from anyview.pusher.render import renderer
from anyview.pusher.scene import ARENA_CENTRE, CAMERA_DISTANCE, CAMERA_ELEVATION, SUBSTEPS
from anyview.pusher.task import PUSH, load_task, task_names

import mujoco  # isort: skip  (after anyview.pusher, which chooses the OpenGL backend)

ROUNDS, RUNS, STEPS = 7, 15, 40


def rates(ours: Callable[[], int], plain: Callable[[], int]) -> np.ndarray:
    """What each does a second, (ROUNDS, 2), in turn; the first round warms up and is left out."""
    rows = []
    for _ in range(ROUNDS + 1):
        pair = []
        for work in (ours, plain):
            started = time.perf_counter()
            count = work()
            pair.append(count / (time.perf_counter() - started))
        rows.append(pair)
    return np.array(rows[1:])


def compare(name: str, ours: Callable[[], int], plain: Callable[[], int], unit: str) -> None:
    """Print the median rates and the ratio round by round."""
    table = rates(ours, plain)
    ratio = table[:, 0] / table[:, 1]
    ours_rate, plain_rate = np.median(table, axis=0)
    print(
        f"{name}: {ours_rate:.0f} against {plain_rate:.0f} {unit}/s, ratio {np.median(ratio):.1f} "
        f"(from {ratio.min():.1f} to {ratio.max():.1f} over {ROUNDS} rounds)"
    )


def expert_steps(contexts: Sequence[Context]) -> Callable[[], int]:
    """The expert's episode in every context, in lockstep."""

    def work() -> int:
        roll_out(contexts)
        return ACTIONS * len(contexts)

    return work


def expert_frames(contexts: Sequence[Context]) -> Callable[[], int]:
    """A frame of every context, in the middle of the expert's episode."""
    positions = roll_out(contexts)[0][:, ACTIONS // 2]
    camera = renderer(contexts[0].task, 64)

    def work() -> int:
        for _ in range(4):
            camera.render(contexts, positions)
        return 4 * len(contexts)

    return work


def plain_frames(contexts: Sequence[Context]) -> Callable[[], int]:
    """The same by ``mujoco.Renderer``."""
    positions = roll_out(contexts)[0][:, ACTIONS // 2]
    scene = copy.copy(load_task(contexts[0].task).model("twist"))
    default = mujoco.MjSpec().visual.quality
    scene.vis.quality.numslices, scene.vis.quality.numstacks = default.numslices, default.numstacks
    scene.vis.quality.numquads = default.numquads
    data = mujoco.MjData(scene)
    camera = mujoco.MjvCamera()
    camera.lookat[:] = [*ARENA_CENTRE, 0.0]
    camera.distance, camera.elevation = CAMERA_DISTANCE, CAMERA_ELEVATION
    shoot = mujoco.Renderer(scene, 64, 64)
    shoot.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = 0

    def work() -> int:
        for _ in range(4):
            for context, position in zip(contexts, positions, strict=True):
                data.qpos[:] = position
                mujoco.mj_forward(scene, data)
                camera.azimuth = np.rad2deg(context.azimuth)
                shoot.update_scene(data, camera)
                shoot.render()
        return 4 * len(contexts)

    return work


def compare_tasks() -> None:
    """Print what the other tasks cost, as multiples of what push costs."""
    contexts = {task: sample_contexts(np.random.default_rng(0), RUNS, task=task)[0] for task in task_names()}
    for task in contexts:
        if task == PUSH:
            continue
        for name, kind in (("a step", expert_steps), ("a frame", expert_frames)):
            table = rates(kind(contexts[task]), kind(contexts[PUSH]))
            ratio = table[:, 1] / table[:, 0]
            print(
                f"{task}, cost of {name}: {np.median(ratio):.2f} of push's "
                f"(from {ratio.min():.2f} to {ratio.max():.2f} over {ROUNDS} rounds)"
            )


def main() -> None:
    """Print every comparison."""
    contexts, _ = sample_contexts(np.random.default_rng(0), RUNS)
    batch = PusherBatch(contexts)
    batch.reset()
    positions = batch.positions()

    compare("rendering, 64x64", expert_frames(contexts), plain_frames(contexts), "frames")

    rng = np.random.default_rng(1)
    actions = rng.uniform(-1, 1, (STEPS, RUNS, 3))
    torque = PusherBatch(contexts, "torque")
    torque_model = load_task("push").model("torque")
    singles = [mujoco.MjData(torque_model) for _ in range(RUNS)]

    def step_ours() -> int:
        torque.reset()
        for action in actions:
            torque.step(action)
        return STEPS * RUNS

    def step_plain() -> int:
        for single, position in zip(singles, positions, strict=True):
            mujoco.mj_resetData(torque_model, single)
            single.qpos[:] = position
        for action in actions:
            for single, control in zip(singles, 3.0 * action, strict=True):
                single.ctrl[:] = control
                mujoco.mj_step(torque_model, single, SUBSTEPS)
        return STEPS * RUNS

    compare("physics, 15 pushers", step_ours, step_plain, "control steps")
    compare_tasks()


if __name__ == "__main__":
    main()
