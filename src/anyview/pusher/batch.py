"""N arms side by side on ``mujoco.batch``: physics, observations and frames of many contexts at once."""

from collections.abc import Sequence
from typing import Any

import mujoco
import mujoco.batch
import numpy as np

from anyview.pusher.contexts import Context
from anyview.pusher.kinematics import joint_velocity, tool_pose, within_workspace
from anyview.pusher.path import ACTIONS, FRAMES
from anyview.pusher.render import renderer
from anyview.pusher.scene import (
    ARENA_CENTRE,
    ARENA_RADIUS,
    CONTROL_SECONDS,
    JOINT_RANGE,
    MAX_JOINT_SPEED,
    MAX_TORQUE,
    SUBSTEPS,
)
from anyview.pusher.task import load_task
from anyview.trigonometry import unit_vector

ACTION_SIZE = 3
OBSERVATION_SIZE = 13  # with one goal and no object; another goal, and each object, adds its place
OBSERVATION_LIMIT = 3.0  # entries are clipped to this; a normal episode stays within about 1
MAX_TWIST = np.array([0.9, 0.9, 3.0])  # m/s, m/s, rad/s at action 1

__all__ = [
    "ACTIONS",
    "ACTION_SIZE",
    "FRAMES",
    "MAX_TWIST",
    "OBSERVATION_LIMIT",
    "OBSERVATION_SIZE",
    "PusherBatch",
    "finite_actions",
    "observation_size",
]


class PusherBatch:
    """``len(contexts)`` arms. An episode is a reset and ``ACTIONS`` steps, the same for all of them.

    All contexts are of one task, and all have one goal or all have two.
    """

    def __init__(self, contexts: Sequence[Context], control: str = "twist", image_size: int = 64):
        self.contexts = list(contexts)
        self.count = len(self.contexts)
        self.task = load_task(self.contexts[0].task)
        self.steps = 0
        self._control = control
        self._image_size = image_size
        self._start = np.array([[*c.arm_qpos, *c.object_xy] for c in self.contexts])
        self._goal = np.array([c.goal_xy for c in self.contexts])
        self._goals = np.array([c.goals for c in self.contexts])
        self._batch = mujoco.batch.Batch(self.task.model(control), nsim=self.count, nthread=1)
        self._qpos, self._qvel, self._ctrl = (self._batch.bind(name) for name in ("qpos", "qvel", "ctrl"))
        self._past: list[np.ndarray] = []  # positions since the start, which the distance may depend on

    def __reduce__(self) -> tuple[Any, ...]:
        # MuJoCo's batch can be neither copied nor pickled. All that its next step depends on is one array.
        state = self._batch.state.copy()
        return _continued, (self.contexts, self._control, self._image_size, self.steps, self._past, state)

    def reset(self) -> np.ndarray:
        """Put every arm at its context's start; observations (N, O)."""
        self._batch.reset()
        self._qpos[:] = self._start
        self._qvel[:] = 0
        self.steps = 0
        self._past = [self.positions()]
        return self.observations()

    def step(self, actions: np.ndarray) -> np.ndarray:
        """Act for 0.1 s with ``actions`` (N, 3) in [-1, 1]; observations (N, O) float32.

        Raises ValueError if an action is not finite, or their shape is another.
        """
        actions = finite_actions(actions, (self.count, ACTION_SIZE)).clip(-1, 1)
        if self._control == "torque":
            self._ctrl[:] = actions * MAX_TORQUE
        else:
            twist = actions * MAX_TWIST
            tool = tool_pose(self._qpos[:, :3])[:, :2]
            target = within_workspace(tool + CONTROL_SECONDS * twist[:, :2], self.task.workspace)
            twist[:, :2] = (target - tool) / CONTROL_SECONDS
            speed = joint_velocity(self._qpos[:, :3], twist)
            # Slow all joints alike, so that the tool keeps its direction.
            excess = np.abs(speed).max(-1, keepdims=True) / MAX_JOINT_SPEED
            self._ctrl[:] = speed / np.maximum(excess, 1)
        self._batch.step(nstep=SUBSTEPS)
        self.steps += 1
        self._past.append(self.positions())
        return self.observations()

    def observations(self) -> np.ndarray:
        """(N, O) float32, each entry about in [-1, 1], O is ``observation_size``.

        Joint angles (3) and speeds (3), tool position (2) and heading as sine and cosine (2), objects (2 k),
        goal (2), or both goals in the order of ``COLOURS`` (4), time (1).
        """
        joints = self._qpos[:, :3]
        tool = tool_pose(joints)
        parts = [
            joints / JOINT_RANGE,
            self._qvel[:, :3] / MAX_JOINT_SPEED,
            _in_arena(tool[:, :2]),
            unit_vector(tool[:, 2])[:, ::-1],
            _in_arena(self._qpos[:, 3:].reshape(self.count, -1, 2)).reshape(self.count, -1),
            _in_arena(self._goals).reshape(self.count, -1),
            np.full((self.count, 1), 2 * self.steps / ACTIONS - 1),
        ]
        return np.concatenate(parts, axis=-1).clip(-OBSERVATION_LIMIT, OBSERVATION_LIMIT).astype(np.float32)

    def positions(self) -> np.ndarray:
        """Joint angles and places of the k objects (N, 3 + 2 k), as ``render`` takes them."""
        return self._qpos.copy()

    def distance(self) -> np.ndarray:
        """Metres (N,) that are left to the goal, by the measure of the task."""
        return self.task.distance(np.stack(self._past, axis=1), self._goal)

    def other_distance(self) -> np.ndarray:
        """The same to the goal that does not count, where there are two."""
        others = np.array([c.choice.other_xy for c in self.contexts if c.choice is not None])
        return self.task.distance(np.stack(self._past, axis=1), others)

    def render(self) -> np.ndarray:
        """What each context's camera sees: (N, H, W, 3) uint8 RGB."""
        return renderer(self.contexts[0].task, self._image_size).render(self.contexts, self._qpos)


def _continued(
    contexts: list[Context],
    control: str,
    image_size: int,
    steps: int,
    past: list[np.ndarray],
    state: np.ndarray,
) -> PusherBatch:
    """A batch whose episode goes on after ``steps`` steps from MuJoCo's ``state`` (N, its size)."""
    pushers = PusherBatch(contexts, control, image_size)
    pushers.steps = steps
    pushers._past = list(past)
    pushers._batch.state[:] = state
    return pushers


def observation_size(task: str, goals: int) -> int:
    """Entries of an observation in ``task`` where there are one or two ``goals``."""
    return OBSERVATION_SIZE + 2 * len(load_task(task).objects) + 2 * (goals - 1)


def finite_actions(actions: Any, shape: tuple[int, ...]) -> np.ndarray:
    """``actions`` as float64; raises ValueError if they are not finite numbers of ``shape``.

    MuJoCo would answer an infinite or undefined control by resetting that simulation, and write a log file.
    """
    try:
        numbers = np.asarray(actions, np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"action: expected numbers of shape {shape}, got {actions!r}") from None
    if numbers.shape != shape:
        raise ValueError(f"action: expected the shape {shape}, got {numbers.shape}")
    if not np.isfinite(numbers).all():
        raise ValueError(f"action: expected finite numbers, got {numbers.tolist()}")
    return numbers


def _in_arena(position: np.ndarray) -> np.ndarray:
    return (position - ARENA_CENTRE) / ARENA_RADIUS
