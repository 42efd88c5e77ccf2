"""What tasks propose contexts with: random places, starts of the arm, and whether it can follow a path.

Every number of a context is rounded to ``DECIMALS`` decimals before anything depends on it. So contexts are
the same even where a library computes another last bit. The exception is a value that lies within this bit of
where rounding or a test decides: less than one context in 10^8.
"""

import numpy as np

from anyview.pusher.kinematics import joints_for
from anyview.pusher.scene import ARENA_CENTRE, WORKSPACE_RADIUS
from anyview.trigonometry import unit_vector

DECIMALS = 6  # of metres, radians and colours
_JOINT_STEP = 0.35  # radians from one frame to the next: no joint wraps round or races


def distance(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Metres (...) between places (..., 2)."""
    return np.linalg.norm(one - other, axis=-1)


def in_disc(
    rng: np.random.Generator, radius: float, count: int, centre: np.ndarray = ARENA_CENTRE
) -> np.ndarray:
    """Points (count, 2) uniform in the disc of ``radius`` around ``centre``, (2,) or (count, 2)."""
    # A little less, so that no point is rounded out of the disc.
    away = (radius - 10.0**-DECIMALS) * np.sqrt(rng.uniform(0, 1, (count, 1)))
    return (centre + away * unit_vector(rng.uniform(-np.pi, np.pi, count))).round(DECIMALS)


def start_around(
    rng: np.random.Generator, pose: np.ndarray, elbow: np.ndarray, metres: tuple[float, float], side: float
) -> tuple[np.ndarray, np.ndarray]:
    """Starts of the arm (P, 3) at ``metres`` from tool poses (P, 3), turned by up to 45 degrees.

    They lie behind the pose, within ``side`` radians of the opposite of its heading. Also whether the arm can
    stand there (P,) on the branch ``elbow`` (P,).
    """
    count = len(pose)
    angle = pose[:, 2] + np.pi + rng.uniform(-side, side, count)
    offset = rng.uniform(*metres, (count, 1)) * unit_vector(angle)
    turn = rng.uniform(-np.pi / 4, np.pi / 4, (count, 1))
    arm_qpos, stands = joints_for(pose + np.concatenate([offset, turn], axis=-1), elbow)
    return arm_qpos.round(DECIMALS), stands


def can_follow(poses: np.ndarray, elbow: np.ndarray, workspace: float = WORKSPACE_RADIUS) -> np.ndarray:
    """Whether the arm can follow tool poses (P, T, 3) within its workspace (P,), on the branch ``elbow``."""
    possible = distance(poses[..., :2], ARENA_CENTRE).max(-1) < workspace
    possible[possible] = joints_for(poses[possible, -1], elbow[possible])[1]  # most fail at the end
    joints, reachable = joints_for(poses[possible], elbow[possible, None])
    steady = np.abs(np.diff(joints, axis=1)).max((1, 2)) < _JOINT_STEP
    possible[possible] = reachable.all(-1) & steady
    return possible
