"""The planar arm's geometry: tool pose from joints, joints from tool pose, Jacobian. All arrays are batched.

A tool pose is (x, y, heading) in metres and radians: the end of the third link and the way the cup points.
"""

import numpy as np

from anyview.pusher.scene import ARENA_CENTRE, JOINT_RANGE, LINK, WORKSPACE_RADIUS


def wrap(angle: np.ndarray) -> np.ndarray:
    """``angle`` brought into [-pi, pi)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


def heading(angle: np.ndarray) -> np.ndarray:
    """Unit vectors (..., 2) that point along ``angle`` (...)."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def tool_pose(joints: np.ndarray) -> np.ndarray:
    """Tool poses (..., 3) for joint angles (..., 3)."""
    angles = np.cumsum(joints, axis=-1)
    position = LINK * heading(angles).sum(axis=-2)
    return np.concatenate([position, angles[..., 2:]], axis=-1)


def jacobian(joints: np.ndarray) -> np.ndarray:
    """d(tool pose)/d(joints), (..., 3, 3)."""
    angles = np.cumsum(joints, axis=-1)
    links = LINK * np.stack([-np.sin(angles), np.cos(angles)], axis=-2)  # (..., 2, link)
    linear = np.cumsum(links[..., ::-1], axis=-1)[..., ::-1]  # joint k moves the links from k outward
    return np.concatenate([linear, np.ones_like(linear[..., :1, :])], axis=-2)


def within_workspace(position: np.ndarray) -> np.ndarray:
    """``position`` (..., 2), or the nearest point (..., 2) of the workspace where it lies outside."""
    offset = position - ARENA_CENTRE
    distance = np.linalg.norm(offset, axis=-1, keepdims=True)
    return np.where(
        distance > WORKSPACE_RADIUS,
        ARENA_CENTRE + offset * (WORKSPACE_RADIUS / distance.clip(1e-9)),
        position,
    )


def joint_velocity(joints: np.ndarray, twist: np.ndarray, damping: float = 0.03) -> np.ndarray:
    """Joint velocities (..., 3) that move the tool by ``twist`` (vx, vy, angular), by damped least squares.

    q' = J^T (J J^T + damping^2 I)^-1 twist stays bounded where the arm is stretched.
    """
    matrix = jacobian(joints)
    transposed = np.swapaxes(matrix, -1, -2)
    normal = matrix @ transposed + damping**2 * np.eye(3)
    return (transposed @ np.linalg.solve(normal, twist[..., None]))[..., 0]


def joints_for(pose: np.ndarray, elbow: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Joints (..., 3) that reach ``pose`` (..., 3) on the branch ``elbow`` (+1 or -1), and whether they can.

    Reachable means within JOINT_RANGE and with the wrist clear of full stretch.
    """
    wrist = pose[..., :2] - LINK * heading(pose[..., 2])
    cosine = (wrist**2).sum(-1) / (2 * LINK**2) - 1
    bend = elbow * np.arccos(np.clip(cosine, -1, 1))
    shoulder = np.arctan2(wrist[..., 1], wrist[..., 0]) - bend / 2  # equal links: the triangle is isosceles
    joints = wrap(np.stack([shoulder, bend, pose[..., 2] - shoulder - bend], axis=-1))
    reachable = (np.abs(joints) < JOINT_RANGE - 0.05).all(-1) & (np.abs(bend) > 0.4)
    return joints, reachable
