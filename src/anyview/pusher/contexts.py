"""Contexts: where the camera, objects, goals, arm and distractors are. Accepted by geometry alone.

A task proposes places and starts of the arm (see ``task``); camera and distractors are as in all tasks.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np

from anyview.pusher.kinematics import wrap
from anyview.pusher.proposals import DECIMALS, in_disc
from anyview.pusher.scene import DISTRACTORS, GOAL_COLOURS, OBJECT_COLOUR
from anyview.pusher.task import PUSH, load_task
from anyview.runtime.errors import AnyviewError

Kind = Literal["diverse", "narrow", "choice"]
Colour = Literal["red", "green"]
COLOURS: tuple[Colour, ...] = ("red", "green")
_COLOUR_DISTANCE = 0.5
_NARROW_JITTER = np.deg2rad(5.0)
_DISTRACTOR_RADIUS = 0.62  # metres: as far from the arena's centre as the camera sees
_DISTRACTOR_CLEARANCE = 0.2  # metres, from the middle of goals and object
_FARTHEST = 100.0  # metres or radians: MuJoCo gives up on huge numbers


@dataclass(frozen=True)
class Distractor:
    """A flat shape on the table that nothing touches: position in metres, RGB in 0 to 1."""

    position: tuple[float, float]
    colour: tuple[float, float, float]
    visible: bool


@dataclass(frozen=True)
class Choice:
    """What a context with two goals has besides: the colour of ``goal_xy``, and the other goal's place."""

    colour: Colour
    other_xy: tuple[float, float]


@dataclass(frozen=True)
class Context:
    """One setting of a task. Angles in radians, lengths in metres.

    ``object_xy`` is x and y of each object of the task, one after another. ``goal_xy`` is where a
    demonstration ends and what success is measured by. Where there are two goals, ``choice`` has the rest,
    and nothing that an agent observes tells which of them counts.
    """

    azimuth: float
    object_xy: tuple[float, ...]
    goal_xy: tuple[float, float]
    arm_qpos: tuple[float, float, float]
    distractors: tuple[Distractor, ...]
    choice: Choice | None = None
    task: str = PUSH

    def __post_init__(self) -> None:
        """Raises ValueError if an angle or a place is none that physics can start from.

        AnyviewError if there is no such task.
        """
        parts: list[tuple[str, Any, tuple[int, ...]]]
        parts = [("azimuth", self.azimuth, ()), ("arm_qpos", self.arm_qpos, (3,))]
        parts += [("object_xy", self.object_xy, (2 * len(load_task(self.task).objects),))]
        parts += [("goal_xy", self.goal_xy, (2,))]
        if self.choice is not None:
            parts.append(("choice.other_xy", self.choice.other_xy, (2,)))
            if self.choice.colour not in COLOURS:
                raise ValueError(f"context: choice.colour: expected {' or '.join(COLOURS)}")
        for name, values, shape in parts:
            try:
                usable = np.shape(values) == shape and (np.abs(values) < _FARTHEST).all()
            except (TypeError, ValueError):
                usable = False
            if not usable:
                wanted = f"{shape[0]} numbers" if shape else "a number"
                raise ValueError(
                    f"context: {name}: expected {wanted} of less than {_FARTHEST:g}, got {values!r}"
                )

    @property
    def goals(self) -> tuple[tuple[float, float], ...]:
        """Places of the goals in the order of ``COLOURS``, whichever counts: one, red, or two."""
        if self.choice is None:
            return (self.goal_xy,)
        both = self.goal_xy, self.choice.other_xy
        return both if self.choice.colour == COLOURS[0] else both[::-1]

    def choosing(self, colour: Colour) -> "Context":
        """This context of two goals where the goal of ``colour`` is the one that counts."""
        assert self.choice is not None
        if colour == self.choice.colour:
            return self
        return replace(self, goal_xy=self.choice.other_xy, choice=Choice(colour, self.goal_xy))

    def to_json(self) -> str:
        """One line of JSON; floats keep every bit. What is as it is in the thesis is left out."""
        usual = {"choice": None, "task": PUSH}
        values = {name: value for name, value in asdict(self).items() if (name, value) not in usual.items()}
        return json.dumps(values, separators=(",", ":"))

    @classmethod
    def from_json(cls, text: str) -> "Context":
        """The context that ``to_json`` wrote."""
        values = json.loads(text)
        distractors = tuple(
            Distractor(tuple(d["position"]), tuple(d["colour"]), d["visible"]) for d in values["distractors"]
        )
        choice = values.get("choice")
        return cls(
            values["azimuth"],
            tuple(values["object_xy"]),
            tuple(values["goal_xy"]),
            tuple(values["arm_qpos"]),
            distractors,
            choice and Choice(choice["colour"], tuple(choice["other_xy"])),
            str(values.get("task", PUSH)),
        )


def sample_contexts(
    rng: np.random.Generator, count: int, kind: Kind = "diverse", task: str = PUSH
) -> tuple[list[Context], float]:
    """Draw ``count`` contexts; also the share of proposals that the geometry accepts.

    Raises AnyviewError if ``task`` has none of that ``kind``.
    """
    world = load_task(task)
    if kind not in world.kinds:
        raise AnyviewError(f"task {task}: no {kind} contexts; it has {' and '.join(world.kinds)}")
    contexts: list[Context] = []
    proposed = accepted = 0
    while len(contexts) < count:
        objects, goals, arm_qpos, tried = world.propose(rng, kind)
        proposed += tried
        accepted += len(arm_qpos)
        for scene in zip(objects, goals, arm_qpos, strict=True):
            contexts.append(_dress(rng, kind, task, *scene))
    return contexts[:count], accepted / proposed


def _dress(
    rng: np.random.Generator,
    kind: Kind,
    task: str,
    objects: np.ndarray,
    goals: np.ndarray,
    arm_qpos: np.ndarray,
) -> Context:
    """Add a camera and distractors of ``kind``; of two ``goals`` (2, 2) chance says which is which colour."""
    if kind == "narrow":
        azimuth = rng.integers(4) * np.pi / 2 + rng.uniform(-_NARROW_JITTER, _NARROW_JITTER)
        distractors: tuple[Distractor, ...] = ()
    else:
        azimuth = rng.uniform(-np.pi, np.pi)
        places = [*objects, *goals]
        distractors = tuple(_distractor(rng, places, COLOURS[: len(goals)]) for _ in range(DISTRACTORS))
    choice = None
    if len(goals) == 2:
        choice = Choice(COLOURS[rng.integers(2)], _pair(goals[1]))
    return Context(
        float(wrap(np.asarray(azimuth)).round(DECIMALS)),
        tuple(map(float, objects.ravel())),
        _pair(goals[0]),
        (float(arm_qpos[0]), float(arm_qpos[1]), float(arm_qpos[2])),
        distractors,
        choice,
        task,
    )


def _pair(place: np.ndarray) -> tuple[float, float]:
    return float(place[0]), float(place[1])


def _distractor(rng: np.random.Generator, places: list[np.ndarray], colours: Sequence[Colour]) -> Distractor:
    """A distractor away from ``places``, and from the object's colour and those of the goals, ``colours``."""
    while True:
        position = in_disc(rng, _DISTRACTOR_RADIUS, 1)[0]
        if min(math.dist(position, place) for place in places) >= _DISTRACTOR_CLEARANCE:
            break
    taken = [OBJECT_COLOUR, *(GOAL_COLOURS[colour] for colour in colours)]
    while True:
        colour = rng.uniform(0, 1, 3).round(DECIMALS)
        if min(math.dist(colour, other) for other in taken) >= _COLOUR_DISTANCE:
            break
    red, green, blue = map(float, colour)
    return Distractor(_pair(position), (red, green, blue), bool(rng.random() < 0.5))
