"""The planar arm's geometry: tool pose from joints, joints from tool pose, Jacobian. All arrays are batched.

A tool pose is (x, y, heading) in metres and radians: the end of the third link and the way the cup points.

Physics and demonstrations rest on this module, and its results have the same bits on every processor. So
nothing here calls BLAS or LAPACK (``@``, ``np.dot``, ``np.linalg.solve``, the norm of a single vector): they
sum in another order on another processor.
"""

import numpy as np

from anyview.pusher.scene import ARENA_CENTRE, JOINT_RANGE, LINK
from anyview.trigonometry import angle_of, unit_vector


def wrap(angle: np.ndarray) -> np.ndarray:
    """``angle`` brought into [-pi, pi)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


def tool_pose(joints: np.ndarray) -> np.ndarray:
    """Tool poses (..., 3) for joint angles (..., 3)."""
    angles = np.cumsum(joints, axis=-1)
    position = LINK * unit_vector(angles).sum(axis=-2)
    return np.concatenate([position, angles[..., 2:]], axis=-1)


def jacobian(joints: np.ndarray) -> np.ndarray:
    """d(tool position)/d(joints), (..., 2, 3). The third row, of the heading, is all ones and left out."""
    links = LINK * unit_vector(np.cumsum(joints, axis=-1))  # (..., link, 2)
    outward = np.cumsum(links[..., ::-1, :], axis=-2)[..., ::-1, :]  # joint k moves the links from k outward
    return np.stack([-outward[..., 1], outward[..., 0]], axis=-2)


def within_workspace(position: np.ndarray, radius: float) -> np.ndarray:
    """``position`` (..., 2), or the nearest point (..., 2) of the workspace where it lies outside."""
    offset = position - ARENA_CENTRE
    distance = np.linalg.norm(offset, axis=-1, keepdims=True)
    return np.where(
        distance > radius,
        ARENA_CENTRE + offset * (radius / distance.clip(1e-9)),
        position,
    )


def joint_velocity(joints: np.ndarray, twist: np.ndarray, damping: float = 0.03) -> np.ndarray:
    """Joint velocities (..., 3) that move the tool by ``twist`` (vx, vy, angular), by damped least squares.

    q' = J^T (J J^T + damping^2 I)^-1 twist stays bounded where the arm is stretched.
    """
    x, y = np.moveaxis(jacobian(joints), -2, 0)
    vx, vy, turn = twist[..., 0], twist[..., 1], twist[..., 2]
    sum_x, sum_y = x.sum(-1), y.sum(-1)
    # J J^T + damping^2 I is 3x3: eliminate the third row, then Cramer's rule for the first two.
    corner = 3 + damping**2
    xx = (x * x).sum(-1) + damping**2 - sum_x * sum_x / corner
    xy = (x * y).sum(-1) - sum_x * sum_y / corner
    yy = (y * y).sum(-1) + damping**2 - sum_y * sum_y / corner
    right_x, right_y = vx - sum_x * turn / corner, vy - sum_y * turn / corner
    determinant = xx * yy - xy * xy
    pull_x = (yy * right_x - xy * right_y) / determinant
    pull_y = (xx * right_y - xy * right_x) / determinant
    pull_turn = (turn - sum_x * pull_x - sum_y * pull_y) / corner
    return x * pull_x[..., None] + y * pull_y[..., None] + pull_turn[..., None]


def joints_for(pose: np.ndarray, elbow: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Joints (..., 3) that reach ``pose`` (..., 3) on the branch ``elbow`` (+1 or -1), and whether they can.

    Reachable means within JOINT_RANGE and with the wrist clear of full stretch.
    """
    wrist = pose[..., :2] - LINK * unit_vector(pose[..., 2])
    cosine = np.clip((wrist**2).sum(-1) / (2 * LINK**2) - 1, -1, 1)
    bend = elbow * angle_of(cosine, np.sqrt(1 - cosine**2))
    # Equal links: the triangle is isosceles.
    shoulder = angle_of(wrist[..., 0], wrist[..., 1]) - bend / 2
    joints = wrap(np.stack([shoulder, bend, pose[..., 2] - shoulder - bend], axis=-1))
    reachable = (np.abs(joints) < JOINT_RANGE - 0.05).all(-1) & (np.abs(bend) > 0.4)
    return joints, reachable
