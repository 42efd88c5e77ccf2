"""What a task is: the plug-in that says what lies on the table, what the arm is to do there, and how it ends.

A task is one module with an instance of ``Task`` named ``TASK``. Everything else takes it by name.
"""

import importlib
import importlib.util
import pkgutil
from abc import ABC, abstractmethod
from functools import cache
from typing import NamedTuple

import mujoco
import numpy as np

from anyview.pusher.scene import WORKSPACE_RADIUS, compiled
from anyview.runtime.errors import AnyviewError

PUSH = "push"  # the thesis's task


class Proposals(NamedTuple):
    """What geometry has accepted of ``proposed`` random settings; A of them, k objects, one or two goals."""

    objects: np.ndarray
    """Places (A, k, 2) in metres."""
    goals: np.ndarray
    """Places (A, 1 or 2, 2) in metres; the first is the one that counts."""
    arm_qpos: np.ndarray
    """Joint angles (A, 3) at the start."""
    proposed: int


class Task(ABC):
    """A task of the planar arm with k objects, each of which slides on the table in x and y.

    Positions (..., 3 + 2 k) are three joint angles in radians, then each object's x and y in metres.
    """

    kinds: tuple[str, ...] = ("diverse", "narrow")
    """Kinds of contexts that it has; "choice" means that it can have two goals."""
    workspace: float = WORKSPACE_RADIUS
    """A commanded twist keeps the tool point within so many metres of the arena's centre."""
    servo: float = 100.0
    """Gain of the joints' velocity servos, in N m s/rad.

    MuJoCo makes a contact answer to the force of a servo as if nothing damped it, so that a stiff one kicks
    what is light and rolls.
    """
    goal_radius: float
    """Of the disc on the table, in metres."""
    tolerance: float
    """A final distance below this is a success, in metres."""
    tool: str
    """MJCF geoms in the frame of the last link: see ``scene.fingers``."""
    objects: tuple[str, ...]
    """MJCF bodies: see ``scene.sliding_body``."""
    phases: tuple[int, ...] = ()
    """Steps at which phases of the expert's script end, its tool at rest; what a varied tempo stretches."""

    def model(self, control: str) -> mujoco.MjModel:
        """The compiled world for ``control`` "twist" or "torque". Shared: do not modify it, copy it."""
        return compiled(self.tool, self.objects, self.goal_radius, self.servo, control)

    @abstractmethod
    def propose(self, rng: np.random.Generator, kind: str) -> Proposals:
        """Draw settings and keep those that geometry accepts; the expert is never run to choose them.

        Numbers are rounded to ``proposals.DECIMALS`` before anything depends on them.
        """

    @abstractmethod
    def expert_poses(self, arm_qpos: np.ndarray, objects: np.ndarray, goal_xy: np.ndarray) -> np.ndarray:
        """The expert's tool poses (P, 50, 3), of which step t means the same progress in all contexts.

        They start at ``arm_qpos`` (P, 3), with ``objects`` (P, k, 2) and ``goal_xy`` (P, 2) on the table.
        """

    @abstractmethod
    def distance(self, positions: np.ndarray, goal_xy: np.ndarray) -> np.ndarray:
        """Metres (P,) left to the goals (P, 2) after an episode's ``positions`` (P, t + 1, 3 + 2 k).

        0 where the task is done as well as it can be; ``tolerance`` decides on success.
        """


@cache
def load_task(name: str) -> Task:
    """The task of ``anyview.tasks.<name>``, or else of a module of your own, ``anyview_<name>``.

    The prefix keeps files that name a task from importing anything else. AnyviewError if there is no such
    task, or if it lacks a part.
    """
    for module in (f"anyview.tasks.{name}", f"anyview_{name}") if name.isidentifier() else ():
        if (found := importlib.util.find_spec(module)) is not None:
            task = getattr(importlib.import_module(module), "TASK", None)
            if not isinstance(task, Task):
                raise AnyviewError(f"task {name}: {found.origin} has no TASK, an instance of Task")
            if missing := [key for key in Task.__annotations__ if not hasattr(task, key)]:
                raise AnyviewError(f"task {name}: {found.origin}: TASK lacks {', '.join(missing)}")
            return task
    known = ", ".join(task_names())
    raise AnyviewError(f"task {name}: no such module; there are {known}, and those of modules anyview_<name>")


def task_names() -> list[str]:
    """The tasks of ``anyview.tasks``."""
    package = importlib.import_module("anyview.tasks")
    return sorted(module.name for module in pkgutil.iter_modules(package.__path__))
