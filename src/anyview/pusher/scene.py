"""The pusher as a MuJoCo model: a 3-DoF planar arm with a cup pushes a disc on a table.

Designed so that 64x64 pixels carry the task. The camera frames the circular arena at about 2 cm a pixel
from every azimuth, the object is blue and 10 pixels wide, the goal red and 13, the table matt grey under
flat light without shadows, and the arm thin and close to the table's grey, so that what changes most between
frames is the object. The links run above the object: only the cup touches it. Some contexts have a second
goal, green and as wide; in the others it is not drawn.
"""

from functools import cache

import mujoco
import numpy as np

LINK = 0.4  # metres, each of the three links
ARENA_CENTRE = np.array([0.62, 0.0])  # metres, seen from the arm's base
ARENA_RADIUS = 0.5  # metres: objects and goals lie within
WORKSPACE_RADIUS = 0.62  # metres: a commanded twist never takes the tool further out, or out of view
OBJECT_RADIUS = 0.1
GOAL_RADIUS = 0.13
OBJECT_COLOUR = np.array([0.05, 0.15, 0.9])
GOAL_COLOURS = {"red": np.array([0.9, 0.08, 0.08]), "green": np.array([0.08, 0.62, 0.12])}
JOINT_RANGE = np.array([2.8, 2.8, 2.8])  # radians, symmetric
DISTRACTORS = 5

# The cup, in the tool's frame (x forward): a crossbar and two splayed fingers, capsules of FINGER_RADIUS.
# A pushed disc touches both fingers and centres itself, its middle SEAT ahead of the tool point.
FINGER_RADIUS = 0.02
CUP = np.array(
    [
        [[0.0, -0.05], [0.0, 0.05]],
        [[0.0, 0.05], [0.1, 0.125]],
        [[0.0, -0.05], [0.1, -0.125]],
    ]
)
SEAT = 2 / 15

CONTROL_SECONDS = 0.1  # 10 Hz
SUBSTEPS = 10
MAX_TORQUE = 3.0  # N m
MAX_JOINT_SPEED = 4.0  # rad/s

CAMERA_DISTANCE = 2.6
CAMERA_ELEVATION = -60.0  # degrees
CAMERA_FOVY = 28.0  # degrees

_LINK_HEIGHT = 0.15
_CUP_HEIGHT = 0.05
_TABLE = "0.56 0.56 0.54 1"
_ARM = "0.72 0.72 0.69 1"
_DARK = "0.12 0.12 0.12 1"


def _distractor(index: int) -> str:
    shape = ('type="cylinder" size="0.06 0.015"', 'type="box" size="0.055 0.055 0.015"')[index % 2]
    return f'<geom name="distractor{index}" class="visual" {shape} pos="0 0 0.015"/>'


def _goal(name: str) -> str:
    shape = f'type="cylinder" size="{GOAL_RADIUS} 0.004" pos="0 0 0.004"'
    return f'<geom name="{name}" class="visual" {shape} rgba="{_rgba(GOAL_COLOURS[name])}"/>'


def _cup() -> str:
    height = _CUP_HEIGHT - _LINK_HEIGHT
    parts = [
        f'<geom class="cup" fromto="{LINK + ax} {ay} {height} {LINK + bx} {by} {height}"/>'
        for (ax, ay), (bx, by) in CUP
    ]
    post = f'<geom class="cup" contype="0" fromto="{LINK} 0 0 {LINK} 0 {height}"/>'
    return "".join([*parts, post])


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


def _actuators(control: str) -> str:
    # The twist is tracked by stiff joint velocity servos; a torque acts on the joint as it is.
    if control == "torque":
        return "".join(
            f'<motor joint="joint{i}" ctrllimited="true" ctrlrange="{-MAX_TORQUE} {MAX_TORQUE}"/>'
            for i in range(3)
        )
    return "".join(f'<velocity joint="joint{i}" kv="100"/>' for i in range(3))


def _rgba(colour: np.ndarray) -> str:
    return " ".join(map(str, colour)) + " 1"


@cache
def model(control: str) -> mujoco.MjModel:
    """The compiled scene for ``control`` "twist" or "torque". Shared: do not modify it, copy it."""
    return mujoco.MjModel.from_xml_string(f"""
<mujoco model="pusher">
  <compiler angle="radian"/>
  <default>
    <default class="visual">
      <geom contype="0" conaffinity="0" mass="0"/>
    </default>
    <default class="link">
      <joint axis="0 0 1" limited="true" damping="1" armature="0.04"/>
      <geom type="capsule" size="0.03" rgba="{_ARM}" contype="0" conaffinity="0" mass="0.05"/>
    </default>
    <default class="cup">
      <geom type="capsule" size="{FINGER_RADIUS}" mass="0.01" condim="1"
        rgba="{_DARK}" contype="2" conaffinity="0"/>
    </default>
    <default class="object">
      <joint type="slide" damping="4"/>
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
    {"".join(map(_goal, GOAL_COLOURS))}
    {"".join(map(_distractor, range(DISTRACTORS)))}
    {_link(0, _link(1, _link(2, _cup())))}
    <body name="object" pos="0 0 {_CUP_HEIGHT}">
      <joint name="object_x" class="object" axis="1 0 0"/>
      <joint name="object_y" class="object" axis="0 1 0"/>
      <geom name="contact" class="object" type="sphere" size="{OBJECT_RADIUS}" mass="0.1" rgba="0 0 0 0"/>
      <geom name="object" class="visual" type="cylinder" size="{OBJECT_RADIUS} {_CUP_HEIGHT}"
        rgba="{_rgba(OBJECT_COLOUR)}"/>
    </body>
  </worldbody>
  <actuator>{_actuators(control)}</actuator>
</mujoco>""")
