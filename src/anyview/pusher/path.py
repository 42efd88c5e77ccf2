"""The expert's path: approach, push and rest, at the same steps in every demonstration.

Clips are paired by time step, so that frame t means the same progress in each of them.
"""

import numpy as np

from anyview.pusher.kinematics import tool_pose, wrap
from anyview.pusher.scene import CUP, FINGER_RADIUS, OBJECT_RADIUS, SEAT
from anyview.trigonometry import angle_of, unit_vector

FRAMES = 50  # of an episode: o_0 after reset, then o_t after action t
ACTIONS = FRAMES - 1
APPROACH_END = 14  # step at which the cup stands behind the object
PUSH_END = 42  # step at which the object lies on the goal; then the expert rests
STANDOFF = 0.04  # metres between the cup's seat and the object before the push
APPROACH_CLEARANCE = 0.02  # metres between cup and object during the approach


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


def minimum_jerk(progress: np.ndarray) -> np.ndarray:
    """Smooth 0 to 1 with zero speed and acceleration at both ends (Flash and Hogan 1985)."""
    s = np.clip(progress, 0, 1)
    return s * s * s * (10 - 15 * s + 6 * s * s)


def expert_poses(arm_qpos: np.ndarray, object_xy: np.ndarray, goal_xy: np.ndarray) -> np.ndarray:
    """Reference tool poses (P, 50, 3) for starts (P, 3), objects (P, 2) and goals (P, 2)."""
    start = tool_pose(arm_qpos)
    behind = push_pose(object_xy, goal_xy)
    end = final_pose(behind, goal_xy)
    turn = behind - start
    turn[:, 2] = wrap(turn[:, 2])
    steps = np.arange(FRAMES)
    approach = minimum_jerk(steps / APPROACH_END)[None, :, None]
    push = minimum_jerk((steps - APPROACH_END) / (PUSH_END - APPROACH_END))[None, :, None]
    return start[:, None] + approach * turn[:, None] + push * (end - behind)[:, None]


def clearance(poses: np.ndarray, object_xy: np.ndarray) -> np.ndarray:
    """Least distance (P,) in metres between cup and object during the approach of ``poses`` (P, T, 3)."""
    approach = poses[:, : APPROACH_END + 1]
    forward = unit_vector(approach[..., 2])
    left = np.stack([-forward[..., 1], forward[..., 0]], axis=-1)
    relative = object_xy[:, None] - approach[..., :2]
    seen = np.stack([(relative * forward).sum(-1), (relative * left).sum(-1)], axis=-1)  # in the tool's frame
    distance = np.full(seen.shape[:2], np.inf)
    for a, b in CUP:
        part = b - a
        along = np.clip(((seen - a) * part).sum(-1) / (part * part).sum(), 0, 1)
        distance = np.minimum(distance, np.linalg.norm(seen - a - along[..., None] * part, axis=-1))
    return distance.min(-1) - FINGER_RADIUS - OBJECT_RADIUS
