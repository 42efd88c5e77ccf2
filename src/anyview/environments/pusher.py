"""The tasks as Gymnasium environments, such as ``anyview/Pusher3DoF-v0``, single and vectorised.

The reward here is the negative distance that is left to the goal in metres, for tests and baselines that know
the true state; imitation replaces it with what the camera sees. Episodes are truncated after 49 actions.
"""

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from anyview.pusher.batch import (
    ACTION_SIZE,
    ACTIONS,
    OBSERVATION_LIMIT,
    PusherBatch,
    finite_actions,
    observation_size,
)
from anyview.pusher.contexts import Context, Kind, sample_contexts
from anyview.pusher.task import PUSH, load_task

_METADATA = {"render_modes": ["rgb_array"], "render_fps": 10}
_BEFORE_RESET = "the environment has no episode yet: call reset() first"


class PusherEnv(gym.Env):
    """One arm at a ``task``. A reset draws a new context of ``kind``, unless ``context`` fixes it.

    Raises ValueError where an argument, an option or an action is not what it has to be, and AnyviewError if
    there is no such task.
    """

    metadata: dict[str, Any] = _METADATA

    def __init__(
        self,
        context: Context | None = None,
        kind: Kind = "diverse",
        control: str = "twist",
        image_size: int = 64,
        render_mode: str | None = None,
        task: str = PUSH,
    ):
        _check_choices(task, kind, control)
        self.render_mode = render_mode
        self._task = task
        self._context = None if context is None else _checked_context(context, task)
        self._goals = _goals([] if context is None else [context], kind)
        self.observation_space, self.action_space = _spaces(task, self._goals)
        self._kind, self._control, self._image_size = kind, control, image_size
        self._batch: PusherBatch | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Start an episode; ``options={"context": ...}`` chooses its context."""
        super().reset(seed=seed)
        _check_options(options, "context")
        context = self._context
        if options:
            context = _checked_context(options["context"], self._task, self._goals)
        drawn = [context or _draw(self.np_random, self._kind, self._task)]
        self._batch = PusherBatch(drawn, self._control, self._image_size)
        return self._batch.reset()[0], _info(self._batch, 0)

    def step(self, action: np.ndarray):
        """Act for 0.1 s with ``action`` (3,), finite."""
        if self._batch is None:
            raise gym.error.ResetNeeded(_BEFORE_RESET)
        observation = self._batch.step(finite_actions(action, (ACTION_SIZE,))[None])[0]
        info = _info(self._batch, 0)
        return observation, -info["distance"], False, self._batch.steps >= ACTIONS, info

    def render(self) -> np.ndarray | None:
        """The context's camera image (H, W, 3) uint8, where ``render_mode`` is "rgb_array"."""
        if self.render_mode is None:
            return None
        if self._batch is None:
            raise gym.error.ResetNeeded(_BEFORE_RESET)
        return self._batch.render()[0]


class PusherVectorEnv(VectorEnv):
    """``num_envs`` arms at a ``task`` on one ``mujoco.batch.Batch``, equal step for step to single ones.

    Raises ValueError where an argument, an option or an action is not what it has to be.
    """

    metadata: dict[str, Any] = {**_METADATA, "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        contexts: Sequence[Context] | None = None,
        kind: Kind = "diverse",
        control: str = "twist",
        image_size: int = 64,
        render_mode: str | None = None,
        task: str = PUSH,
    ):
        if contexts is not None and len(contexts) != num_envs:
            raise ValueError(f"{len(contexts)} contexts for {num_envs} environments")
        _check_choices(task, kind, control)
        self.num_envs = num_envs
        self._task = task
        self._contexts = None if contexts is None else [_checked_context(each, task) for each in contexts]
        goals = _goals(self._contexts or [], kind)
        self.single_observation_space, self.single_action_space = _spaces(task, goals)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.render_mode = render_mode
        self._kind, self._control, self._image_size = kind, control, image_size
        self._generators: list[np.random.Generator] = []
        self._batch: PusherBatch | None = None

    def reset(self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None):
        """Start an episode everywhere; an integer ``seed`` seeds environment i with ``seed + i``."""
        _check_options(options)
        if isinstance(seed, Sequence) and len(seed) != self.num_envs:
            raise ValueError(f"{len(seed)} seeds for {self.num_envs} environments")
        if seed is not None or not self._generators:
            seeds = [seed + i if isinstance(seed, int) else seed for i in range(self.num_envs)]
            if isinstance(seed, Sequence):
                seeds = list(seed)
            self._generators = [gym.utils.seeding.np_random(each)[0] for each in seeds]  # type: ignore[arg-type]
        contexts = self._contexts or [_draw(each, self._kind, self._task) for each in self._generators]
        self._batch = PusherBatch(contexts, self._control, self._image_size)
        return self._batch.reset(), self._info()

    def step(self, actions: np.ndarray):
        """Act for 0.1 s everywhere with ``actions`` (num_envs, 3), finite.

        The step after the last one of an episode resets instead, whatever its actions.
        """
        if self._batch is None:
            raise gym.error.ResetNeeded(_BEFORE_RESET)
        never = np.zeros(self.num_envs, bool)
        if self._batch.steps >= ACTIONS:
            observations, info = self.reset()
            return observations, np.zeros(self.num_envs), never, never.copy(), info
        observations = self._batch.step(actions)
        truncated = np.full(self.num_envs, self._batch.steps >= ACTIONS)
        return observations, -self._batch.distance(), never, truncated, self._info()

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Every context's camera image, where ``render_mode`` is "rgb_array"."""
        if self.render_mode is None:
            return None
        if self._batch is None:
            raise gym.error.ResetNeeded(_BEFORE_RESET)
        return tuple(self._batch.render())

    def _info(self) -> dict[str, Any]:
        assert self._batch is not None
        distance = self._batch.distance()
        everywhere = np.ones(self.num_envs, bool)
        return {
            "distance": distance,
            "_distance": everywhere,
            "is_success": distance < self._batch.task.tolerance,
            "_is_success": everywhere.copy(),
        }


def _goals(contexts: Sequence[Context], kind: str) -> int:
    """Goals in every one of ``contexts``, or without any in those of ``kind``."""
    counts = {len(context.goals) for context in contexts} or {2 if kind == "choice" else 1}
    if len(counts) > 1:
        raise ValueError("contexts: some have one goal and some have two")
    return counts.pop()


def _spaces(task: str, goals: int) -> tuple[gym.spaces.Box, gym.spaces.Box]:
    """The spaces of observations and actions, new for each environment: a space has a random generator."""
    shape = (observation_size(task, goals),)
    observations = gym.spaces.Box(-OBSERVATION_LIMIT, OBSERVATION_LIMIT, shape, np.float32)
    return observations, gym.spaces.Box(-1.0, 1.0, (ACTION_SIZE,), np.float32)


def _draw(rng: np.random.Generator, kind: Kind, task: str) -> Context:
    return sample_contexts(rng, 1, kind, task)[0][0]


def _check_choices(task: str, kind: str, control: str) -> None:
    for name, value, choices in (
        ("kind", kind, load_task(task).kinds),
        ("control", control, ("twist", "torque")),
    ):
        if value not in choices:
            raise ValueError(f"{name} {value!r}: must be {' or '.join(choices)}")


def _checked_context(context: Any, task: str, goals: int | None = None) -> Context:
    if not isinstance(context, Context):
        raise ValueError(f"context: expected a Context (see anyview.pusher.contexts), got {context!r}")
    if context.task != task:
        raise ValueError(f"context: it is one of task {context.task}, but the environment is for {task}")
    if goals is not None and len(context.goals) != goals:
        raise ValueError(f"context: it has {len(context.goals)} goals, but the environment is for {goals}")
    return context


def _check_options(options: dict[str, Any] | None, *known: str) -> None:
    for name in options or {}:
        if name not in known:
            raise ValueError(f"options: {name!r}: expected {' or '.join(map(repr, known)) or 'none'}")


def _info(batch: PusherBatch, index: int) -> dict[str, Any]:
    distance = float(batch.distance()[index])
    return {"distance": distance, "is_success": distance < batch.task.tolerance}
