"""Sweep: five grains are swept into a zone by a broom.

The grains are blue and 4 pixels wide, the zone red and 18. The geometry asks that the expert's straight way,
from behind the grains to the zone, and its approach are within the arm's reach and workspace, and that the
approach is clear of the grains.
"""

import numpy as np

from anyview.pusher.kinematics import tool_pose
from anyview.pusher.path import clearance, through
from anyview.pusher.proposals import DECIMALS, can_follow, distance, in_disc, start_around
from anyview.pusher.scene import (
    ARENA_RADIUS,
    FINGER_HEIGHT,
    FINGER_RADIUS,
    OBJECT_COLOUR,
    fingers,
    rgba,
    sliding_body,
)
from anyview.pusher.task import Proposals, Task
from anyview.trigonometry import angle_of, unit_vector

GRAINS = 5
SWEPT = 4  # grains in the zone make a success
GRAIN_RADIUS = 0.04
ZONE_RADIUS = 0.18
SEPARATION = 0.45  # metres, at least, from the middle of the grains to the zone's

# A bar with short ends, so that no grain slips past.
BROOM = np.array(
    [
        [[0.0, -0.15], [0.0, 0.15]],
        [[0.0, 0.15], [0.06, 0.18]],
        [[0.0, -0.15], [0.06, -0.18]],
    ]
)

APPROACH_END = 14  # step at which the broom stands behind the grains
SWEEP_END = 42  # step at which they lie in the zone; then the expert rests
STANDOFF = 0.04  # metres between bar and grains before the sweep
APPROACH_CLEARANCE = 0.02  # metres between broom and grains during the approach

_RING = (0.08, 0.095)  # metres from the grains' middle to each of them, evenly around it
_BEHIND = _RING[1] + GRAIN_RADIUS + FINGER_RADIUS + STANDOFF  # metres from the grains' middle to the bar
_SHORT = 0.06  # metres by which the bar stops short of the zone's middle, with the grains ahead of it
_WITHIN = ARENA_RADIUS - 0.05  # metres from the arena's centre: grains and zone are seen whole
_START_DISTANCE = (0.1, 0.4)  # metres from the place behind the grains
_START_SIDE = np.deg2rad(110.0)
_PROPOSALS = 8192


class Sweep(Task):
    """Grains that move no further than they are pushed, by the broom or by each other."""

    goal_radius = ZONE_RADIUS
    tolerance = ZONE_RADIUS
    tool = fingers(BROOM)
    objects = tuple(
        sliding_body(
            f"grain{grain}",
            f'<geom class="touched" type="sphere" size="{GRAIN_RADIUS}" mass="0.02" contype="4"'
            f' conaffinity="6" rgba="0 0 0 0"/>'
            f'<geom class="visual" type="cylinder" size="{GRAIN_RADIUS} {FINGER_HEIGHT}"'
            f' rgba="{rgba(OBJECT_COLOUR)}"/>',
            damping=0.8,
        )
        for grain in range(GRAINS)
    )

    def propose(self, rng: np.random.Generator, kind: str) -> Proposals:
        """See ``Task``."""
        middle = in_disc(rng, _WITHIN, _PROPOSALS)
        zone_xy = in_disc(rng, _WITHIN, _PROPOSALS)
        grains = _around(rng, middle)
        elbow = rng.choice([-1.0, 1.0], _PROPOSALS)
        arm_qpos, stands = start_around(rng, sweep_pose(grains, zone_xy), elbow, _START_DISTANCE, _START_SIDE)
        keep = stands & (distance(middle, zone_xy) >= SEPARATION)
        grains, zone_xy, arm_qpos, elbow = (part[keep] for part in (grains, zone_xy, arm_qpos, elbow))
        poses = self.expert_poses(arm_qpos, grains, zone_xy)
        keep = can_follow(poses, elbow)
        approach = poses[keep, : APPROACH_END + 1]
        keep[keep] = clearance(BROOM, GRAIN_RADIUS, approach, grains[keep]) > APPROACH_CLEARANCE
        return Proposals(grains[keep], zone_xy[keep, None], arm_qpos[keep], _PROPOSALS)

    def expert_poses(self, arm_qpos: np.ndarray, objects: np.ndarray, goal_xy: np.ndarray) -> np.ndarray:
        """Approach, sweep and rest: see ``Task``."""
        behind = sweep_pose(objects, goal_xy)
        position = goal_xy - _SHORT * unit_vector(behind[:, 2])
        end = np.concatenate([position, behind[:, 2:]], axis=-1)
        return through([tool_pose(arm_qpos), behind, end], [0, APPROACH_END, SWEEP_END])

    def distance(self, positions: np.ndarray, goal_xy: np.ndarray) -> np.ndarray:
        """Of the fourth nearest grain to the zone's centre: see ``Task``."""
        grains = positions[:, -1, 3:].reshape(-1, GRAINS, 2)
        return np.sort(distance(grains, goal_xy[:, None]), axis=-1)[:, SWEPT - 1]


def sweep_pose(grains: np.ndarray, zone_xy: np.ndarray) -> np.ndarray:
    """Tool poses (P, 3) behind the middle of ``grains`` (P, 5, 2), facing the zone."""
    middle = grains.mean(1)
    way = zone_xy - middle
    direction = angle_of(way[:, 0], way[:, 1])
    return np.concatenate([middle - _BEHIND * unit_vector(direction), direction[:, None]], axis=-1)


def _around(rng: np.random.Generator, middle: np.ndarray) -> np.ndarray:
    """Grains (P, 5, 2) in a ring around each ``middle`` (P, 2), turned by chance and a little uneven."""
    turn = rng.uniform(-np.pi, np.pi, (len(middle), 1)) + 2 * np.pi / GRAINS * np.arange(GRAINS)
    away = rng.uniform(*_RING, (len(middle), GRAINS, 1))
    return (middle[:, None] + away * unit_vector(turn)).round(DECIMALS)


TASK = Sweep()
