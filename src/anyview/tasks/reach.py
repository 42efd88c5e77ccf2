"""Reach: the tool goes to a red disc on the table. No object.

The tool is a blue knob, so that 64x64 pixels show where it is. The geometry asks that the straight way to the
disc, on which the tool keeps its heading, is within the arm's reach and workspace.
"""

import numpy as np

from anyview.pusher.kinematics import joints_for, tool_pose
from anyview.pusher.path import through
from anyview.pusher.proposals import DECIMALS, can_follow, distance, in_disc
from anyview.pusher.scene import ARENA_RADIUS, OBJECT_COLOUR, knob
from anyview.pusher.task import Proposals, Task

SEPARATION = 0.45  # metres, at least, from tool to disc at the start
REACH_END = 35  # step at which the tool is there; then the expert rests
_KNOB_RADIUS = 0.07
_PROPOSALS = 4096


class Reach(Task):
    """The tool point over the middle of the disc."""

    goal_radius = 0.13
    tolerance = 0.02
    tool = knob(_KNOB_RADIUS, OBJECT_COLOUR)
    objects = ()

    def propose(self, rng: np.random.Generator, kind: str) -> Proposals:
        """See ``Task``."""
        start_xy = in_disc(rng, ARENA_RADIUS, _PROPOSALS)
        goal_xy = in_disc(rng, ARENA_RADIUS, _PROPOSALS)
        heading = rng.uniform(-np.pi, np.pi, (_PROPOSALS, 1))
        elbow = rng.choice([-1.0, 1.0], _PROPOSALS)
        arm_qpos, stands = joints_for(np.concatenate([start_xy, heading], axis=-1), elbow)
        arm_qpos = arm_qpos.round(DECIMALS)
        nothing = np.empty((_PROPOSALS, 0, 2))
        keep = stands & (distance(start_xy, goal_xy) >= SEPARATION)
        keep[keep] = can_follow(self.expert_poses(arm_qpos[keep], nothing[keep], goal_xy[keep]), elbow[keep])
        return Proposals(nothing[keep], goal_xy[keep, None], arm_qpos[keep], _PROPOSALS)

    def expert_poses(self, arm_qpos: np.ndarray, objects: np.ndarray, goal_xy: np.ndarray) -> np.ndarray:
        """Straight to the disc, and rest: see ``Task``."""
        start = tool_pose(arm_qpos)
        there = np.concatenate([goal_xy, start[:, 2:]], axis=-1)
        return through([start, there], [0, REACH_END])

    def distance(self, positions: np.ndarray, goal_xy: np.ndarray) -> np.ndarray:
        """From the tool point to the disc's centre: see ``Task``."""
        return distance(tool_pose(positions[:, -1])[:, :2], goal_xy)


TASK = Reach()
