"""The expert's path: from pose to pose, at the same steps in every demonstration of a task.

Clips are paired by time step, so that frame t means the same progress in each of them; unless they keep a
tempo of their own (see ``tempo``).
"""

from collections.abc import Sequence

import numpy as np

from anyview.pusher.kinematics import wrap
from anyview.pusher.scene import FINGER_RADIUS
from anyview.trigonometry import unit_vector

FRAMES = 50  # of an episode: o_0 after reset, then o_t after action t
ACTIONS = FRAMES - 1


def minimum_jerk(progress: np.ndarray) -> np.ndarray:
    """Smooth 0 to 1 with zero speed and acceleration at both ends (Flash and Hogan 1985)."""
    s = np.clip(progress, 0, 1)
    return s * s * s * (10 - 15 * s + 6 * s * s)


def through(poses: Sequence[np.ndarray], steps: Sequence[int]) -> np.ndarray:
    """Tool poses (P, 50, 3) that pass through ``poses``, each (P, 3), at ``steps``, and rest at the last.

    Between two of them tool and heading move straight, by ``minimum_jerk``.
    """
    path = np.repeat(poses[0][:, None], FRAMES, axis=1)
    times = np.arange(FRAMES)
    for here, there, begin, end in zip(poses, poses[1:], steps, steps[1:], strict=False):
        turn = there - here
        turn[:, 2] = wrap(turn[:, 2])
        path = path + minimum_jerk((times - begin) / (end - begin))[None, :, None] * turn[:, None]
    return path


def clearance(fingers: np.ndarray, radius: float, poses: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Least distance (P,) in metres between a tool and discs of ``radius`` along its ``poses`` (P, T, 3).

    ``fingers`` (F, 2, 2) are those of ``scene.fingers``; the k discs lie at ``places`` (P, k, 2).
    """
    forward = unit_vector(poses[:, None, :, 2])
    left = np.stack([-forward[..., 1], forward[..., 0]], axis=-1)
    relative = places[:, :, None] - poses[:, None, :, :2]
    seen = np.stack([(relative * forward).sum(-1), (relative * left).sum(-1)], axis=-1)  # in the tool's frame
    distance = np.full(seen.shape[:3], np.inf)
    for a, b in fingers:
        part = b - a
        along = np.clip(((seen - a) * part).sum(-1) / (part * part).sum(), 0, 1)
        distance = np.minimum(distance, np.linalg.norm(seen - a - along[..., None] * part, axis=-1))
    return distance.min((1, 2)) - FINGER_RADIUS - radius
