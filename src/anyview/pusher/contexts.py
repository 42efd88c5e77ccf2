"""Contexts: where the camera, object, goal, arm and distractors are. Accepted by geometry alone.

The geometry asks that the expert's straight push, from behind the object to the goal, and its approach are
within the arm's reach and workspace and clear of the object. The expert is never run to choose contexts.

Every number of a context is rounded to ``_DECIMALS`` decimals before anything depends on it. So contexts are
the same even where a library computes another last bit. The exception is a value that lies within this bit of
where rounding or a test decides: less than one context in 10^8.
"""

import json
import math
from dataclasses import asdict, dataclass
from typing import Literal

import numpy as np

from anyview.pusher.kinematics import joints_for, wrap
from anyview.pusher.path import APPROACH_CLEARANCE, clearance, expert_poses, push_pose
from anyview.pusher.scene import (
    ARENA_CENTRE,
    ARENA_RADIUS,
    DISTRACTORS,
    GOAL_COLOUR,
    OBJECT_COLOUR,
    WORKSPACE_RADIUS,
)
from anyview.trigonometry import unit_vector

Kind = Literal["diverse", "narrow"]
SEPARATION = 0.45  # metres, at least, from object to goal
_COLOUR_DISTANCE = 0.5
_NARROW_JITTER = np.deg2rad(5.0)
_DISTRACTOR_RADIUS = 0.62  # metres: as far from the arena's centre as the camera sees
_DISTRACTOR_CLEARANCE = 0.2  # metres, from the middle of goal and object
_DECIMALS = 6  # of metres, radians and colours
_PROPOSALS = 4096
_FARTHEST = 100.0  # metres or radians: MuJoCo gives up on huge numbers
_START_DISTANCE = (0.1, 0.4)  # metres from the place behind the object
_START_SIDE = np.deg2rad(110.0)
_JOINT_STEP = 0.35  # radians from one frame to the next: no joint wraps round or races


@dataclass(frozen=True)
class Distractor:
    """A flat shape on the table that nothing touches: position in metres, RGB in 0 to 1."""

    position: tuple[float, float]
    colour: tuple[float, float, float]
    visible: bool


@dataclass(frozen=True)
class Context:
    """One setting of the task. Angles in radians, lengths in metres."""

    azimuth: float
    object_xy: tuple[float, float]
    goal_xy: tuple[float, float]
    arm_qpos: tuple[float, float, float]
    distractors: tuple[Distractor, ...]

    def __post_init__(self) -> None:
        """Raises ValueError if an angle or a place is none that physics can start from."""
        for name, shape in (("azimuth", ()), ("object_xy", (2,)), ("goal_xy", (2,)), ("arm_qpos", (3,))):
            values = getattr(self, name)
            try:
                usable = np.shape(values) == shape and (np.abs(values) < _FARTHEST).all()
            except (TypeError, ValueError):
                usable = False
            if not usable:
                wanted = f"{shape[0]} numbers" if shape else "a number"
                raise ValueError(
                    f"context: {name}: expected {wanted} of less than {_FARTHEST:g}, got {values!r}"
                )

    def to_json(self) -> str:
        """One line of JSON; floats keep every bit."""
        return json.dumps(asdict(self), separators=(",", ":"))

    @classmethod
    def from_json(cls, text: str) -> "Context":
        """The context that ``to_json`` wrote."""
        values = json.loads(text)
        distractors = tuple(
            Distractor(tuple(d["position"]), tuple(d["colour"]), d["visible"]) for d in values["distractors"]
        )
        return cls(
            values["azimuth"],
            tuple(values["object_xy"]),
            tuple(values["goal_xy"]),
            tuple(values["arm_qpos"]),
            distractors,
        )


def sample_contexts(
    rng: np.random.Generator, count: int, kind: Kind = "diverse"
) -> tuple[list[Context], float]:
    """Draw ``count`` contexts; also the share of proposals that the geometry accepts."""
    contexts: list[Context] = []
    proposed = accepted = 0
    while len(contexts) < count:
        object_xy, goal_xy, arm_qpos = _propose(rng)
        proposed += _PROPOSALS
        accepted += len(object_xy)
        for scene in zip(object_xy, goal_xy, arm_qpos, strict=True):
            contexts.append(_dress(rng, kind, *scene))
    return contexts[:count], accepted / proposed


def _propose(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Objects (P, 2), goals (P, 2) and arm's starts (P, 3) that the geometry accepts out of _PROPOSALS."""
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

    keep = stands & (np.linalg.norm(goal_xy - object_xy, axis=-1) >= SEPARATION)
    object_xy, goal_xy, arm_qpos, elbow = (part[keep] for part in (object_xy, goal_xy, arm_qpos, elbow))
    poses = expert_poses(arm_qpos, object_xy, goal_xy)
    inside = np.linalg.norm(poses[..., :2] - ARENA_CENTRE, axis=-1).max(-1) < WORKSPACE_RADIUS
    keep = inside & (clearance(poses, object_xy) > APPROACH_CLEARANCE)
    object_xy, goal_xy, arm_qpos, elbow, poses = (
        part[keep] for part in (object_xy, goal_xy, arm_qpos, elbow, poses)
    )
    joints, reachable = joints_for(poses, elbow[:, None])
    steady = np.abs(np.diff(joints, axis=1)).max((1, 2)) < _JOINT_STEP
    keep = reachable.all(-1) & steady
    return object_xy[keep], goal_xy[keep], arm_qpos[keep]


def _dress(
    rng: np.random.Generator, kind: Kind, object_xy: np.ndarray, goal_xy: np.ndarray, arm_qpos: np.ndarray
) -> Context:
    """Add a camera and distractors of ``kind``."""
    if kind == "narrow":
        azimuth = rng.integers(4) * np.pi / 2 + rng.uniform(-_NARROW_JITTER, _NARROW_JITTER)
        distractors: tuple[Distractor, ...] = ()
    else:
        azimuth = rng.uniform(-np.pi, np.pi)
        distractors = tuple(_distractor(rng, object_xy, goal_xy) for _ in range(DISTRACTORS))
    return Context(
        float(wrap(np.asarray(azimuth)).round(_DECIMALS)),
        (float(object_xy[0]), float(object_xy[1])),
        (float(goal_xy[0]), float(goal_xy[1])),
        (float(arm_qpos[0]), float(arm_qpos[1]), float(arm_qpos[2])),
        distractors,
    )


def _distractor(rng: np.random.Generator, object_xy: np.ndarray, goal_xy: np.ndarray) -> Distractor:
    while True:
        position = _in_disc(rng, _DISTRACTOR_RADIUS, 1)[0]
        if min(math.dist(position, object_xy), math.dist(position, goal_xy)) >= _DISTRACTOR_CLEARANCE:
            break
    while True:
        colour = rng.uniform(0, 1, 3).round(_DECIMALS)
        if min(math.dist(colour, GOAL_COLOUR), math.dist(colour, OBJECT_COLOUR)) >= _COLOUR_DISTANCE:
            break
    red, green, blue = map(float, colour)
    return Distractor((float(position[0]), float(position[1])), (red, green, blue), bool(rng.random() < 0.5))


def _in_disc(rng: np.random.Generator, radius: float, count: int) -> np.ndarray:
    """Points (count, 2) uniform in the disc of ``radius`` around the arena's centre."""
    # A little less, so that no point is rounded out of the disc.
    distance = (radius - 10.0**-_DECIMALS) * np.sqrt(rng.uniform(0, 1, (count, 1)))
    return (ARENA_CENTRE + distance * unit_vector(rng.uniform(-np.pi, np.pi, count))).round(_DECIMALS)
