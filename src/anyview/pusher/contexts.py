"""Contexts: where the camera, object, goals, arm and distractors are. Accepted by geometry alone.

The geometry asks that the expert's straight push, from behind the object to the goal, and its approach are
within the arm's reach and workspace and clear of the object. The expert is never run to choose contexts.
Where there are two goals, both pushes are possible from where the arm starts.

Every number of a context is rounded to ``_DECIMALS`` decimals before anything depends on it. So contexts are
the same even where a library computes another last bit. The exception is a value that lies within this bit of
where rounding or a test decides: less than one context in 10^8.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np

from anyview.pusher.kinematics import joints_for, wrap
from anyview.pusher.path import APPROACH_CLEARANCE, clearance, expert_poses, final_pose, push_pose
from anyview.pusher.scene import (
    ARENA_CENTRE,
    ARENA_RADIUS,
    DISTRACTORS,
    GOAL_COLOURS,
    OBJECT_COLOUR,
    WORKSPACE_RADIUS,
)
from anyview.trigonometry import unit_vector

Kind = Literal["diverse", "narrow", "choice"]
Colour = Literal["red", "green"]
COLOURS: tuple[Colour, ...] = ("red", "green")
SEPARATION = 0.45  # metres, at least, from object to goal and from goal to goal
_COLOUR_DISTANCE = 0.5
_NARROW_JITTER = np.deg2rad(5.0)
_DISTRACTOR_RADIUS = 0.62  # metres: as far from the arena's centre as the camera sees
_DISTRACTOR_CLEARANCE = 0.2  # metres, from the middle of goals and object
_DECIMALS = 6  # of metres, radians and colours
_PROPOSALS = 4096
_PLACES = 32_768  # proposed at once where there are two goals
_FARTHEST = 100.0  # metres or radians: MuJoCo gives up on huge numbers
_START_DISTANCE = (0.1, 0.4)  # metres from the place behind the object
_START_SIDE = np.deg2rad(110.0)
_START_AROUND = (0.2, 0.5)  # metres from the object, where there are two goals
_STARTS = 32  # tried where there are two goals
_JOINT_STEP = 0.35  # radians from one frame to the next: no joint wraps round or races


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
    """One setting of the task. Angles in radians, lengths in metres.

    ``goal_xy`` is where a demonstration ends and what success is measured by. Where there are two goals,
    ``choice`` has the rest, and nothing that an agent observes tells which of them counts.
    """

    azimuth: float
    object_xy: tuple[float, float]
    goal_xy: tuple[float, float]
    arm_qpos: tuple[float, float, float]
    distractors: tuple[Distractor, ...]
    choice: Choice | None = None

    def __post_init__(self) -> None:
        """Raises ValueError if an angle or a place is none that physics can start from."""
        parts: list[tuple[str, Any, tuple[int, ...]]]
        parts = [("azimuth", self.azimuth, ()), ("arm_qpos", self.arm_qpos, (3,))]
        parts += [(f"{name}_xy", getattr(self, f"{name}_xy"), (2,)) for name in ("object", "goal")]
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
        """One line of JSON; floats keep every bit."""
        values = {name: value for name, value in asdict(self).items() if value is not None}
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
        )


def sample_contexts(
    rng: np.random.Generator, count: int, kind: Kind = "diverse"
) -> tuple[list[Context], float]:
    """Draw ``count`` contexts; also the share of proposals that the geometry accepts."""
    propose, proposals = (_propose_two_goals, _PLACES) if kind == "choice" else (_propose, _PROPOSALS)
    contexts: list[Context] = []
    proposed = accepted = 0
    while len(contexts) < count:
        object_xy, goals, arm_qpos = propose(rng)
        proposed += proposals
        accepted += len(object_xy)
        for scene in zip(object_xy, goals, arm_qpos, strict=True):
            contexts.append(_dress(rng, kind, *scene))
    return contexts[:count], accepted / proposed


def _propose(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Objects (P, 2), goals (P, 1, 2) and arm's starts (P, 3) that the geometry accepts out of _PROPOSALS."""
    object_xy = _in_disc(rng, ARENA_RADIUS, _PROPOSALS)
    goal_xy = _in_disc(rng, ARENA_RADIUS, _PROPOSALS)
    elbow = rng.choice([-1.0, 1.0], _PROPOSALS)
    # The arm starts around the place behind the object, away from the goal, turned by up to 45 degrees.
    behind = push_pose(object_xy, goal_xy)
    side = behind[:, 2] + np.pi + rng.uniform(-_START_SIDE, _START_SIDE, _PROPOSALS)
    offset = rng.uniform(*_START_DISTANCE, (_PROPOSALS, 1)) * unit_vector(side)
    turn = rng.uniform(-np.pi / 4, np.pi / 4, (_PROPOSALS, 1))
    start = behind + np.concatenate([offset, turn], axis=-1)
    arm_qpos, stands = joints_for(start, elbow)
    arm_qpos = arm_qpos.round(_DECIMALS)

    keep = stands & (_distance(goal_xy, object_xy) >= SEPARATION)
    object_xy, goal_xy, arm_qpos, elbow = (part[keep] for part in (object_xy, goal_xy, arm_qpos, elbow))
    keep = _can_push(object_xy, goal_xy, arm_qpos, elbow)
    return object_xy[keep], goal_xy[keep, None], arm_qpos[keep]


def _propose_two_goals(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As ``_propose`` with goals (P, 2, 2): both pushes are possible from the arm's start.

    Places are accepted in one of 10,000 proposals. So they come first, and the arm's start, of which one in
    ten fits, is drawn for them.
    """
    object_xy = _in_disc(rng, ARENA_RADIUS, _PLACES)
    goals = np.stack([_in_disc(rng, ARENA_RADIUS, _PLACES) for _ in range(2)], axis=1)
    elbow = rng.choice([-1.0, 1.0], _PLACES)
    apart = np.stack([_distance(goals[:, 0], goals[:, 1]), *_distance(goals, object_xy[:, None]).T])
    keep = (apart >= SEPARATION).all(0)
    object_xy, goals, elbow = object_xy[keep], goals[keep], elbow[keep]
    # First the pushes by themselves, and of these first the ends: most places fail there.
    for goal in range(2):
        behind = push_pose(object_xy, goals[:, goal])
        ends = np.stack([behind, final_pose(behind, goals[:, goal])], axis=1)
        keep = (_distance(ends[..., :2], ARENA_CENTRE) < WORKSPACE_RADIUS).all(-1)
        keep &= joints_for(ends, elbow[:, None])[1].all(-1)
        object_xy, goals, elbow = object_xy[keep], goals[keep], elbow[keep]
    for goal in range(2):
        arm_qpos, _ = joints_for(push_pose(object_xy, goals[:, goal]), elbow)
        keep = _can_push(object_xy, goals[:, goal], arm_qpos, elbow)
        object_xy, goals, elbow = object_xy[keep], goals[keep], elbow[keep]

    # The arm starts around the object, away from both goals, turned by up to 45 degrees.
    object_xy, goals, elbow = (np.repeat(part, _STARTS, axis=0) for part in (object_xy, goals, elbow))
    way = push_pose(object_xy[:, None], goals)[..., 2]
    between = way[:, 0] + wrap(way[:, 1] - way[:, 0]) / 2
    side = between + np.pi + rng.uniform(-np.pi / 4, np.pi / 4, len(between))
    position = object_xy + rng.uniform(*_START_AROUND, (len(between), 1)) * unit_vector(side)
    heading = between + rng.uniform(-np.pi / 4, np.pi / 4, len(between))
    arm_qpos, fits = joints_for(np.concatenate([position, heading[:, None]], axis=-1), elbow)
    arm_qpos = arm_qpos.round(_DECIMALS)
    for goal in range(2):
        fits[fits] = _can_push(object_xy[fits], goals[fits, goal], arm_qpos[fits], elbow[fits])
    tries = fits.reshape(-1, _STARTS)
    chosen = np.flatnonzero(tries.any(-1)) * _STARTS + tries.argmax(-1)[tries.any(-1)]
    return object_xy[chosen], goals[chosen], arm_qpos[chosen]


def _can_push(
    object_xy: np.ndarray, goal_xy: np.ndarray, arm_qpos: np.ndarray, elbow: np.ndarray
) -> np.ndarray:
    """Whether the expert's way (P,) stays in reach and workspace, and off the object until the push."""
    poses = expert_poses(arm_qpos, object_xy, goal_xy)
    inside = _distance(poses[..., :2], ARENA_CENTRE).max(-1) < WORKSPACE_RADIUS
    possible = inside & (clearance(poses, object_xy) > APPROACH_CLEARANCE)
    joints, reachable = joints_for(poses[possible], elbow[possible, None])
    steady = np.abs(np.diff(joints, axis=1)).max((1, 2)) < _JOINT_STEP
    possible[possible] = reachable.all(-1) & steady
    return possible


def _dress(
    rng: np.random.Generator, kind: Kind, object_xy: np.ndarray, goals: np.ndarray, arm_qpos: np.ndarray
) -> Context:
    """Add a camera and distractors of ``kind``; of two ``goals`` (2, 2) chance says which is which colour."""
    if kind == "narrow":
        azimuth = rng.integers(4) * np.pi / 2 + rng.uniform(-_NARROW_JITTER, _NARROW_JITTER)
        distractors: tuple[Distractor, ...] = ()
    else:
        azimuth = rng.uniform(-np.pi, np.pi)
        places = [object_xy, *goals]
        distractors = tuple(_distractor(rng, places, COLOURS[: len(goals)]) for _ in range(DISTRACTORS))
    choice = None
    if len(goals) == 2:
        choice = Choice(COLOURS[rng.integers(2)], _pair(goals[1]))
    return Context(
        float(wrap(np.asarray(azimuth)).round(_DECIMALS)),
        _pair(object_xy),
        _pair(goals[0]),
        (float(arm_qpos[0]), float(arm_qpos[1]), float(arm_qpos[2])),
        distractors,
        choice,
    )


def _pair(place: np.ndarray) -> tuple[float, float]:
    return float(place[0]), float(place[1])


def _distractor(rng: np.random.Generator, places: list[np.ndarray], colours: Sequence[Colour]) -> Distractor:
    """A distractor away from ``places``, and from the object's colour and those of the goals, ``colours``."""
    while True:
        position = _in_disc(rng, _DISTRACTOR_RADIUS, 1)[0]
        if min(math.dist(position, place) for place in places) >= _DISTRACTOR_CLEARANCE:
            break
    taken = [OBJECT_COLOUR, *(GOAL_COLOURS[colour] for colour in colours)]
    while True:
        colour = rng.uniform(0, 1, 3).round(_DECIMALS)
        if min(math.dist(colour, other) for other in taken) >= _COLOUR_DISTANCE:
            break
    red, green, blue = map(float, colour)
    return Distractor(_pair(position), (red, green, blue), bool(rng.random() < 0.5))


def _distance(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.linalg.norm(one - other, axis=-1)


def _in_disc(rng: np.random.Generator, radius: float, count: int) -> np.ndarray:
    """Points (count, 2) uniform in the disc of ``radius`` around the arena's centre."""
    # A little less, so that no point is rounded out of the disc.
    distance = (radius - 10.0**-_DECIMALS) * np.sqrt(rng.uniform(0, 1, (count, 1)))
    return (ARENA_CENTRE + distance * unit_vector(rng.uniform(-np.pi, np.pi, count))).round(_DECIMALS)
