"""The world as a MuJoCo model: a 3-DoF planar arm on a table, with the tool and the objects of a task.

Designed so that 64x64 pixels carry a task. The camera frames the circular arena at about 2 cm a pixel from
every azimuth, the table is matt grey under flat light without shadows, and the arm thin and close to the
table's grey, so that what changes most between frames is what the task is about. The links run above the
objects: only the tool touches them.
"""

from functools import cache

import mujoco
import numpy as np

LINK = 0.4  # metres, each of the three links
ARENA_CENTRE = np.array([0.62, 0.0])  # metres, seen from the arm's base
ARENA_RADIUS = 0.5  # metres: objects and goals lie within
WORKSPACE_RADIUS = 0.62  # metres: a commanded twist never takes the tool further out, or out of view
OBJECT_COLOUR = np.array([0.05, 0.15, 0.9])
GOAL_COLOURS = {"red": np.array([0.9, 0.08, 0.08]), "green": np.array([0.08, 0.62, 0.12])}
JOINT_RANGE = np.array([2.8, 2.8, 2.8])  # radians, symmetric
DISTRACTORS = 5

FINGER_RADIUS = 0.02
FINGER_HEIGHT = 0.05  # of a tool above the table

CONTROL_SECONDS = 0.1  # 10 Hz
SUBSTEPS = 10
MAX_TORQUE = 3.0  # N m
MAX_JOINT_SPEED = 4.0  # rad/s

CAMERA_DISTANCE = 2.6
CAMERA_ELEVATION = -60.0  # degrees
CAMERA_FOVY = 28.0  # degrees

_LINK_HEIGHT = 0.15
_TABLE = "0.56 0.56 0.54 1"
_ARM = "0.72 0.72 0.69 1"
_DARK = "0.12 0.12 0.12 1"


def _distractor(index: int) -> str:
    shape = ('type="cylinder" size="0.06 0.015"', 'type="box" size="0.055 0.055 0.015"')[index % 2]
    return f'<geom name="distractor{index}" class="visual" {shape} pos="0 0 0.015"/>'


def fingers(parts: np.ndarray) -> str:
    """MJCF of a tool below the last link: capsules between points (F, 2, 2) in its frame, x forward."""
    height = FINGER_HEIGHT - _LINK_HEIGHT
    capsules = [
        f'<geom class="tool" fromto="{LINK + ax} {ay} {height} {LINK + bx} {by} {height}"/>'
        for (ax, ay), (bx, by) in parts
    ]
    post = f'<geom class="tool" contype="0" fromto="{LINK} 0 0 {LINK} 0 {height}"/>'
    return "".join([*capsules, post])


def knob(radius: float, colour: np.ndarray) -> str:
    """MJCF of a tool that touches nothing: a disc around the tool point, below the last link."""
    height = FINGER_HEIGHT - _LINK_HEIGHT
    shape = f'type="cylinder" size="{radius} {FINGER_HEIGHT / 2}" pos="{LINK} 0 {height}"'
    return f'<geom class="visual" {shape} mass="0.01" rgba="{rgba(colour)}"/>'


def sliding_body(name: str, geoms: str, damping: float) -> str:
    """MJCF of an object that slides in x and y and never turns; ``damping`` in N s/m.

    Tools touch geoms of class "touched", without friction; those of class "visual" are seen only.
    """
    joints = [
        f'<joint name="{name}_{axis}" type="slide" axis="{direction}" damping="{damping}"/>'
        for axis, direction in (("x", "1 0 0"), ("y", "0 1 0"))
    ]
    return f'<body name="{name}" pos="0 0 {FINGER_HEIGHT}">{"".join(joints)}{geoms}</body>'


def rgba(colour: np.ndarray) -> str:
    """MJCF of an opaque ``colour``."""
    return " ".join(map(str, colour)) + " 1"


def _goal(name: str, radius: float) -> str:
    shape = f'type="cylinder" size="{radius} 0.004" pos="0 0 0.004"'
    return f'<geom name="{name}" class="visual" {shape} rgba="{rgba(GOAL_COLOURS[name])}"/>'


def _link(index: int, inner: str) -> str:
    height = _LINK_HEIGHT if index == 0 else 0.0
    reach = 0.0 if index == 0 else LINK
    limit = JOINT_RANGE[index]
    return (
        f'<body name="link{index}" pos="{reach} 0 {height}">'
        f'<joint name="joint{index}" class="link" range="{-limit} {limit}"/>'
        f'<geom class="link" fromto="0 0 0 {LINK} 0 0"/>'
        f"{inner}</body>"
    )


def _actuators(control: str, servo: float) -> str:
    # The twist is tracked by joint velocity servos; a torque acts on the joint as it is.
    if control == "torque":
        return "".join(
            f'<motor joint="joint{i}" ctrllimited="true" ctrlrange="{-MAX_TORQUE} {MAX_TORQUE}"/>'
            for i in range(3)
        )
    return "".join(f'<velocity joint="joint{i}" kv="{servo}"/>' for i in range(3))


@cache
def compiled(
    tool: str, objects: tuple[str, ...], goal_radius: float, servo: float, control: str
) -> mujoco.MjModel:
    """The compiled world of a task: see ``task.Task``, whose ``model`` calls this."""
    return mujoco.MjModel.from_xml_string(f"""
<mujoco model="anyview">
  <compiler angle="radian"/>
  <default>
    <default class="visual">
      <geom contype="0" conaffinity="0" mass="0"/>
    </default>
    <default class="link">
      <joint axis="0 0 1" limited="true" damping="1" armature="0.04"/>
      <geom type="capsule" size="0.03" rgba="{_ARM}" contype="0" conaffinity="0" mass="0.05"/>
    </default>
    <default class="tool">
      <geom type="capsule" size="{FINGER_RADIUS}" mass="0.01" condim="1"
        rgba="{_DARK}" contype="2" conaffinity="0"/>
    </default>
    <default class="touched">
      <geom contype="0" conaffinity="2" condim="1"/>
    </default>
  </default>
  <option timestep="{CONTROL_SECONDS / SUBSTEPS}" integrator="implicitfast" gravity="0 0 0"/>
  <visual>
    <global fovy="{CAMERA_FOVY}"/>
    <quality shadowsize="0" offsamples="0" numslices="16" numstacks="2" numquads="1"/>
    <headlight ambient="0.55 0.55 0.55" diffuse="0.2 0.2 0.2" specular="0 0 0"/>
  </visual>
  <worldbody>
    <light directional="true" dir="-0.2 0.1 -1" diffuse="0.4 0.4 0.4" specular="0 0 0" castshadow="false"/>
    <geom name="table" class="visual" type="plane" size="4 4 1" rgba="{_TABLE}"/>
    {"".join(_goal(name, goal_radius) for name in GOAL_COLOURS)}
    {"".join(map(_distractor, range(DISTRACTORS)))}
    {_link(0, _link(1, _link(2, tool)))}
    {"".join(objects)}
  </worldbody>
  <actuator>{_actuators(control, servo)}</actuator>
</mujoco>""")
