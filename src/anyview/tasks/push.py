"""Push: a disc is pushed by a cup to a goal, or to one of two. The thesis's task.

Designed so that 64x64 pixels carry it. The object is blue and 10 pixels wide, the goal red and 13. Some
contexts have a second goal, green and as wide; in the others it is not drawn.

The geometry asks that the expert's straight push, from behind the object to the goal, and its approach are
within the arm's reach and workspace and clear of the object. Where there are two goals, both pushes are
possible from where the arm starts.
"""

import numpy as np

from anyview.pusher.kinematics import joints_for, tool_pose, wrap
from anyview.pusher.path import clearance, through
from anyview.pusher.proposals import DECIMALS, can_follow, distance, in_disc, start_around
from anyview.pusher.scene import (
    ARENA_CENTRE,
    ARENA_RADIUS,
    FINGER_HEIGHT,
    OBJECT_COLOUR,
    WORKSPACE_RADIUS,
    fingers,
    rgba,
    sliding_body,
)
from anyview.pusher.task import Proposals, Task
from anyview.trigonometry import angle_of, unit_vector

OBJECT_RADIUS = 0.1
GOAL_RADIUS = 0.13
TOLERANCE = 0.02  # metres from object to goal in the last frame: success
SEPARATION = 0.45  # metres, at least, from object to goal and from goal to goal

# A crossbar and two splayed fingers. A pushed disc touches both fingers and centres itself, its middle SEAT
# ahead of the tool point.
CUP = np.array(
    [
        [[0.0, -0.05], [0.0, 0.05]],
        [[0.0, 0.05], [0.1, 0.125]],
        [[0.0, -0.05], [0.1, -0.125]],
    ]
)
SEAT = 2 / 15

APPROACH_END = 14  # step at which the cup stands behind the object
PUSH_END = 42  # step at which the object lies on the goal; then the expert rests
STANDOFF = 0.04  # metres between the cup's seat and the object before the push
APPROACH_CLEARANCE = 0.02  # metres between cup and object during the approach

_PROPOSALS = 4096
_PLACES = 32_768  # proposed at once where there are two goals
_START_DISTANCE = (0.1, 0.4)  # metres from the place behind the object
_START_SIDE = np.deg2rad(110.0)
_START_AROUND = (0.2, 0.5)  # metres from the object, where there are two goals
_STARTS = 32  # tried where there are two goals


class Push(Task):
    """A disc that moves no further than it is pushed."""

    kinds = ("diverse", "narrow", "choice")
    goal_radius = GOAL_RADIUS
    tolerance = TOLERANCE
    tool = fingers(CUP)
    phases = (APPROACH_END, PUSH_END)
    objects = (
        sliding_body(
            "object",
            f'<geom class="touched" type="sphere" size="{OBJECT_RADIUS}" mass="0.1" rgba="0 0 0 0"/>'
            f'<geom class="visual" type="cylinder" size="{OBJECT_RADIUS} {FINGER_HEIGHT}"'
            f' rgba="{rgba(OBJECT_COLOUR)}"/>',
            damping=4,
        ),
    )

    def propose(self, rng: np.random.Generator, kind: str) -> Proposals:
        """See ``Task``."""
        return _propose_two_goals(rng) if kind == "choice" else _propose(rng)

    def expert_poses(self, arm_qpos: np.ndarray, objects: np.ndarray, goal_xy: np.ndarray) -> np.ndarray:
        """Approach, push and rest: see ``Task``."""
        behind = push_pose(objects[:, 0], goal_xy)
        poses = [tool_pose(arm_qpos), behind, final_pose(behind, goal_xy)]
        return through(poses, [0, APPROACH_END, PUSH_END])

    def distance(self, positions: np.ndarray, goal_xy: np.ndarray) -> np.ndarray:
        """From the object's centre to the goal's: see ``Task``."""
        return distance(positions[:, -1, 3:], goal_xy)


def push_pose(object_xy: np.ndarray, goal_xy: np.ndarray) -> np.ndarray:
    """Tool poses (..., 3) that stand behind the object, facing the goal."""
    way = goal_xy - object_xy
    direction = angle_of(way[..., 0], way[..., 1])
    position = object_xy - (SEAT + STANDOFF) * unit_vector(direction)
    return np.concatenate([position, direction[..., None]], axis=-1)


def final_pose(behind: np.ndarray, goal_xy: np.ndarray) -> np.ndarray:
    """Tool poses (..., 3) with the object on the goal, after a push from ``behind`` (..., 3)."""
    position = goal_xy - SEAT * unit_vector(behind[..., 2])
    return np.concatenate([position, behind[..., 2:]], axis=-1)


def _propose(rng: np.random.Generator) -> Proposals:
    object_xy = in_disc(rng, ARENA_RADIUS, _PROPOSALS)
    goal_xy = in_disc(rng, ARENA_RADIUS, _PROPOSALS)
    elbow = rng.choice([-1.0, 1.0], _PROPOSALS)
    behind = push_pose(object_xy, goal_xy)
    arm_qpos, stands = start_around(rng, behind, elbow, _START_DISTANCE, _START_SIDE)
    keep = stands & (distance(goal_xy, object_xy) >= SEPARATION)
    object_xy, goal_xy, arm_qpos, elbow = (part[keep] for part in (object_xy, goal_xy, arm_qpos, elbow))
    keep = _can_push(object_xy, goal_xy, arm_qpos, elbow)
    return Proposals(object_xy[keep, None], goal_xy[keep, None], arm_qpos[keep], _PROPOSALS)


def _propose_two_goals(rng: np.random.Generator) -> Proposals:
    """As ``_propose`` with two goals: both pushes are possible from the arm's start.

    Places are accepted in one of 10,000 proposals. So they come first, and the arm's start, of which one in
    ten fits, is drawn for them.
    """
    object_xy = in_disc(rng, ARENA_RADIUS, _PLACES)
    goals = np.stack([in_disc(rng, ARENA_RADIUS, _PLACES) for _ in range(2)], axis=1)
    elbow = rng.choice([-1.0, 1.0], _PLACES)
    apart = np.stack([distance(goals[:, 0], goals[:, 1]), *distance(goals, object_xy[:, None]).T])
    keep = (apart >= SEPARATION).all(0)
    object_xy, goals, elbow = object_xy[keep], goals[keep], elbow[keep]
    # First the pushes by themselves, and of these first the ends: most places fail there.
    for goal in range(2):
        behind = push_pose(object_xy, goals[:, goal])
        ends = np.stack([behind, final_pose(behind, goals[:, goal])], axis=1)
        keep = (distance(ends[..., :2], ARENA_CENTRE) < WORKSPACE_RADIUS).all(-1)
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
    arm_qpos = arm_qpos.round(DECIMALS)
    for goal in range(2):
        fits[fits] = _can_push(object_xy[fits], goals[fits, goal], arm_qpos[fits], elbow[fits])
    tries = fits.reshape(-1, _STARTS)
    chosen = np.flatnonzero(tries.any(-1)) * _STARTS + tries.argmax(-1)[tries.any(-1)]
    return Proposals(object_xy[chosen, None], goals[chosen], arm_qpos[chosen], _PLACES)


def _can_push(
    object_xy: np.ndarray, goal_xy: np.ndarray, arm_qpos: np.ndarray, elbow: np.ndarray
) -> np.ndarray:
    """Whether the arm can follow the expert's way (P,), off the object until the push."""
    objects = object_xy[:, None]
    poses = TASK.expert_poses(arm_qpos, objects, goal_xy)
    possible = clearance(CUP, OBJECT_RADIUS, poses[:, : APPROACH_END + 1], objects) > APPROACH_CLEARANCE
    possible[possible] = can_follow(poses[possible], elbow[possible])
    return possible


TASK = Push()
