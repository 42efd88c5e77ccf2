"""Strike: a ball that rolls is struck once, and comes to rest in a zone that the arm cannot reach.

The ball is blue and 6 pixels wide, the zone red and 14. The geometry asks that approach and stroke are within
the arm's reach and a small workspace in the middle of the table, and that the approach is clear of the ball.
"""

import numpy as np

from anyview.pusher.kinematics import tool_pose
from anyview.pusher.path import clearance, minimum_jerk, through
from anyview.pusher.proposals import can_follow, distance, in_disc, start_around
from anyview.pusher.scene import (
    ARENA_CENTRE,
    CONTROL_SECONDS,
    FINGER_RADIUS,
    OBJECT_COLOUR,
    fingers,
    rgba,
    sliding_body,
)
from anyview.pusher.task import Proposals, Task
from anyview.trigonometry import angle_of, unit_vector

BALL_RADIUS = 0.06
BALL_MASS = 0.1
ROLL_SECONDS = 0.6  # in which a rolling ball slows down to 1/e of its speed
ZONE_RADIUS = 0.14
RELEASE = 0.15  # metres before the zone: from there on the arm leaves the ball alone
_TOUCH = 0.005  # metres between tool and ball: nearer than this they may have touched

MALLET = np.array([[[0.0, -0.08], [0.0, 0.08]]])  # a bar: the ball leaves it straight ahead
SEAT = BALL_RADIUS + FINGER_RADIUS  # metres from the tool point to the middle of a ball that touches the bar

APPROACH_END = 14  # step at which the mallet stands behind the ball
STROKE_END = 21  # step at which it stands still again; the ball left it halfway, and rolls
STANDOFF = 0.03  # metres between the mallet's seat and the ball before the stroke
APPROACH_CLEARANCE = 0.015  # metres between mallet and ball during the approach

_WORKSPACE = 0.25  # metres: so a ball that the mallet only pushes stays within 0.33 of the arena's centre
_BALL_WITHIN = 0.1  # metres from the arena's centre
_ZONE_FROM, _ZONE_TO = 0.46, 0.5  # metres from the arena's centre
_WAY = 0.41  # metres from ball to zone: the expert lets go 4 cm before it has to, which 64 pixels show as two
_START_DISTANCE = (0.05, 0.2)  # metres from the place behind the ball
_START_SIDE = np.deg2rad(110.0)
_PROPOSALS = 16_384


def _stroke_per_metre() -> float:
    """How far the mallet moves to make the ball end one metre further.

    The ball keeps the mallet's speed of the fastest step, and rolls for as far as that speed times
    ``ROLL_SECONDS``.
    """
    path = minimum_jerk(np.arange(STROKE_END - APPROACH_END + 1) / (STROKE_END - APPROACH_END))
    fastest = int(np.diff(path).argmax())
    rolls = ROLL_SECONDS * (path[fastest + 1] - path[fastest]) / CONTROL_SECONDS
    return 1 / (path[fastest + 1] + rolls)


class Strike(Task):
    """A ball whose only friction is in proportion to its speed."""

    workspace = _WORKSPACE
    servo = 10.0  # softer, so that a ball that rolls takes on the mallet's speed and not more
    goal_radius = ZONE_RADIUS
    tolerance = ZONE_RADIUS - BALL_RADIUS  # the whole ball lies in the zone
    tool = fingers(MALLET)
    objects = (
        sliding_body(
            "ball",
            f'<geom class="touched" type="sphere" size="{BALL_RADIUS}" mass="{BALL_MASS}"'
            f' rgba="{rgba(OBJECT_COLOUR)}"/>',
            damping=BALL_MASS / ROLL_SECONDS,
        ),
    )

    def propose(self, rng: np.random.Generator, kind: str) -> Proposals:
        """See ``Task``."""
        ball_xy = in_disc(rng, _BALL_WITHIN, _PROPOSALS)
        zone_xy = in_disc(rng, _ZONE_TO, _PROPOSALS)
        elbow = rng.choice([-1.0, 1.0], _PROPOSALS)
        arm_qpos, stands = start_around(
            rng, strike_pose(ball_xy, zone_xy), elbow, _START_DISTANCE, _START_SIDE
        )
        keep = stands & (distance(zone_xy, ARENA_CENTRE) >= _ZONE_FROM) & (distance(ball_xy, zone_xy) >= _WAY)
        ball_xy, zone_xy, arm_qpos, elbow = (part[keep] for part in (ball_xy, zone_xy, arm_qpos, elbow))
        objects = ball_xy[:, None]
        poses = self.expert_poses(arm_qpos, objects, zone_xy)
        keep = can_follow(poses, elbow, _WORKSPACE)
        approach = poses[keep, : APPROACH_END + 1]
        keep[keep] = clearance(MALLET, BALL_RADIUS, approach, objects[keep]) > APPROACH_CLEARANCE
        return Proposals(objects[keep], zone_xy[keep, None], arm_qpos[keep], _PROPOSALS)

    def expert_poses(self, arm_qpos: np.ndarray, objects: np.ndarray, goal_xy: np.ndarray) -> np.ndarray:
        """Approach, one stroke, and rest while the ball rolls: see ``Task``."""
        behind = strike_pose(objects[:, 0], goal_xy)
        way = STANDOFF + distance(objects[:, 0], goal_xy)
        stroke = _stroke_per_metre() * way[:, None] * unit_vector(behind[:, 2])
        end = np.concatenate([behind[:, :2] + stroke, behind[:, 2:]], axis=-1)
        return through([tool_pose(arm_qpos), behind, end], [0, APPROACH_END, STROKE_END])

    def distance(self, positions: np.ndarray, goal_xy: np.ndarray) -> np.ndarray:
        """From the ball's centre to the zone's: see ``Task``.

        A ball that was not let go of ``RELEASE`` before the zone ends no nearer than that.
        """
        left = distance(positions[:, -1, 3:], goal_xy)
        barred = self.tolerance + RELEASE
        near = distance(positions[..., 3:], goal_xy[:, None]) < barred
        held = (near & (_gap(positions) < _TOUCH)).any(-1)
        return np.where(held, np.maximum(left, barred), left)


def strike_pose(ball_xy: np.ndarray, zone_xy: np.ndarray) -> np.ndarray:
    """Tool poses (P, 3) that stand behind the ball, facing the zone."""
    way = zone_xy - ball_xy
    direction = angle_of(way[:, 0], way[:, 1])
    return np.concatenate([ball_xy - (SEAT + STANDOFF) * unit_vector(direction), direction[:, None]], axis=-1)


def _gap(positions: np.ndarray) -> np.ndarray:
    """Metres (P, T) between mallet and ball at ``positions`` (P, T, 5)."""
    moments = positions.reshape(-1, 1, 5)
    gaps = clearance(MALLET, BALL_RADIUS, tool_pose(moments[..., :3]), moments[..., 3:])
    return gaps.reshape(positions.shape[:2])


TASK = Strike()
