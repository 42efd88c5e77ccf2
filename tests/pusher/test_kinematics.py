"""The arm's geometry against MuJoCo and finite differences."""

import mujoco
import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from anyview.pusher.kinematics import jacobian, joint_velocity, joints_for, tool_pose, wrap
from anyview.pusher.scene import LINK
from anyview.pusher.task import load_task

joints = npst.arrays(float, 3, elements=st.floats(-2.7, 2.7))
twists = npst.arrays(float, 3, elements=st.floats(-1, 1))


@given(joints)
def test_tool_pose_equals_mujoco(angles: np.ndarray) -> None:
    scene = load_task("push").model("twist")
    data = mujoco.MjData(scene)
    data.qpos[:3] = angles
    mujoco.mj_kinematics(scene, data)
    rotation = data.body("link2").xmat.reshape(3, 3)
    expected = data.body("link2").xpos + rotation @ [LINK, 0, 0]
    x, y, direction = tool_pose(angles)
    np.testing.assert_allclose([x, y], expected[:2], atol=1e-9)
    np.testing.assert_allclose([np.cos(direction), np.sin(direction)], rotation[:2, 0], atol=1e-9)


@given(joints)
def test_jacobian_equals_finite_differences(angles: np.ndarray) -> None:
    step = 1e-6
    numeric = np.stack(
        [(tool_pose(angles + step * e) - tool_pose(angles - step * e)) / (2 * step) for e in np.eye(3)],
        axis=-1,
    )
    np.testing.assert_allclose(jacobian(angles), numeric[:2], atol=1e-7)
    np.testing.assert_allclose(numeric[2], 1, atol=1e-7)


@given(joints)
def test_inverse_kinematics_finds_the_joints_again(angles: np.ndarray) -> None:
    found, reachable = joints_for(tool_pose(angles), np.sign(angles[1]))
    if reachable:
        np.testing.assert_allclose(wrap(found - angles), 0, atol=1e-6)
    else:  # near stretched, folded or a joint's limit
        assert abs(angles[1]) < 0.41 or (np.abs(wrap(angles)) > 2.7).any() or (np.abs(angles) > 2.6).any()


@given(joints, twists, st.floats(0.01, 0.1))
def test_joint_velocity_is_the_damped_least_squares_solution(
    angles: np.ndarray, twist: np.ndarray, damping: float
) -> None:
    matrix = np.vstack([jacobian(angles), np.ones(3)])
    # The minimum of |J q' - twist|^2 + damping^2 |q'|^2, as one overdetermined system.
    system = np.vstack([matrix, damping * np.eye(3)])
    expected, *_ = np.linalg.lstsq(system, np.append(twist, np.zeros(3)))
    np.testing.assert_allclose(joint_velocity(angles, twist, damping), expected, atol=1e-8)


@given(joints, twists)
def test_joint_velocity_moves_the_tool_by_the_twist_up_to_its_damping(
    angles: np.ndarray, twist: np.ndarray
) -> None:
    matrix = np.vstack([jacobian(angles), np.ones(3)])
    weakest = np.linalg.svd(matrix, compute_uv=False)[-1]
    error = np.linalg.norm(matrix @ joint_velocity(angles, twist, damping=0.03) - twist)
    assert error <= 0.03**2 / (weakest**2 + 0.03**2) * np.linalg.norm(twist) + 1e-9
    if abs(np.sin(angles[1])) > 0.9:
        assert error <= 0.05 * np.linalg.norm(twist) + 1e-9
