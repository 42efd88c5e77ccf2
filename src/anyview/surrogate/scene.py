"""The tabletop rig as a MuJoCo scene: table, room, operator with a tool, object, target, other things."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from anyview.runtime.graphics import load_mujoco
from anyview.surrogate.arm import bend, lean
from anyview.surrogate.mjcf import geom, numbers, rgba
from anyview.surrogate.push import CUP_DEPTH, CUP_HALF_WIDTH, OBJECT_RADIUS, TARGET_HALF, Push
from anyview.surrogate.textures import TABLES, materials_xml, texture_files
from anyview.surrogate.things import THING_COLOURS, Thing, thing_xml
from anyview.trigonometry import unit_vector

mujoco = load_mujoco()

OBJECT_COLOUR = (0.08, 0.20, 0.55)
TARGET_COLOUR = (0.74, 0.11, 0.10)
OTHER_TARGET_COLOURS = ((0.95, 0.80, 0.10), (0.15, 0.62, 0.20), (0.95, 0.50, 0.10), (0.55, 0.20, 0.65))
_SLEEVES = ((0.28, 0.32, 0.36), (0.20, 0.24, 0.20), (0.46, 0.42, 0.38), (0.13, 0.13, 0.16))
_SKINS = ((0.82, 0.60, 0.48), (0.62, 0.42, 0.31), (0.45, 0.29, 0.20), (0.88, 0.68, 0.57))

_ROD_TILT = 0.80  # radians that the tool's rod leans back from upright
_GRIP = 0.25  # metres along the rod from the cup to the hand
_UPPER_ARM, _FOREARM = 0.33, 0.31
_SHOULDER = np.array([0.17, -0.62, 0.34])
_OUTWARDS = np.array([0.8, -0.2, -0.5])  # where the elbow hangs


@dataclass(frozen=True)
class View:
    """Where a camera stands: it looks at ``target`` from ``azimuth``, ``elevation`` and ``distance``."""

    azimuth: float  # radians
    elevation: float  # radians
    distance: float  # metres
    target: tuple[float, float, float]
    roll: float
    fovy: float  # radians, of the rendered picture

    def xml(self, name: str) -> str:
        """The MJCF camera."""
        east, north = unit_vector(self.azimuth)
        level, rise = unit_vector(self.elevation)
        back = np.array([level * east, level * north, rise])
        right = np.array([-north, east, 0.0])
        up = np.cross(back, right)
        cosine, sine = unit_vector(self.roll)
        x = cosine * right + sine * up
        y = cosine * up - sine * right
        position = np.array(self.target) + self.distance * back
        place = f'pos="{numbers(*position)}" xyaxes="{numbers(*x, *y)}"'
        return f'<camera name="{name}" {place} fovy="{np.degrees(self.fovy):.4f}"/>'


class Scene:
    """A demonstration's scene, ready to be rendered at any time from any of its cameras."""

    def __init__(
        self,
        push: Push,
        views: Sequence[View],
        things: Sequence[Thing],
        target_colour: tuple[float, float, float],
        size: tuple[int, int],
        rng: np.random.Generator,
    ):
        """``size`` is (width, height) of the pictures; ``rng`` draws the day: table, clothes, light."""
        xml = _scene_xml(push, views, things, target_colour, size, rng)
        self._push = push
        self._model = mujoco.MjModel.from_xml_string(xml, texture_files())
        self._data = mujoco.MjData(self._model)
        self._renderer = mujoco.Renderer(self._model, height=size[1], width=size[0])
        for flag in ("mjRND_REFLECTION", "mjRND_SKYBOX", "mjRND_HAZE", "mjRND_FOG"):
            self._renderer.scene.flags[getattr(mujoco.mjtRndFlag, flag)] = 0

    def render(self, view: int, time: float) -> np.ndarray:
        """The picture (H, W, 3), uint8 RGB, that view number ``view`` sees at ``time``."""
        self._pose(*self._push.at(time))
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        self._renderer.update_scene(self._data, camera=f"view{view}")
        return self._renderer.render()

    def close(self) -> None:
        """Free the OpenGL context."""
        self._renderer.close()

    def _pose(self, cup: np.ndarray, object_xy: np.ndarray) -> None:
        x, y, height, heading = cup
        self._place("object", (*object_xy, 0.0), 0.0)
        self._place("tool", (x, y, height), heading)
        rod = np.array([*-math.sin(_ROD_TILT) * unit_vector(heading), math.cos(_ROD_TILT)])
        wrist = np.array([x, y, height + 0.02]) + (_GRIP + 0.05) * rod
        shoulder = lean(_SHOULDER, wrist, _UPPER_ARM + _FOREARM)
        elbow = bend(shoulder, wrist, _UPPER_ARM, _FOREARM, _OUTWARDS)
        self._place("torso", (shoulder - _SHOULDER) * (1.0, 1.0, 0.0), 0.0)
        self._span("forearm", wrist, elbow)
        self._span("upper_arm", elbow, shoulder)

    def _place(self, body: str, position: Sequence[float] | np.ndarray, yaw: float) -> None:
        mocap = self._model.body(body).mocapid[0]
        self._data.mocap_pos[mocap] = position
        self._data.mocap_quat[mocap] = (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2))

    def _span(self, body: str, begin: np.ndarray, end: np.ndarray) -> None:
        mocap = self._model.body(body).mocapid[0]
        self._data.mocap_pos[mocap] = begin
        direction = (end - begin) / math.dist(begin, end)
        mujoco.mju_quatZ2Vec(self._data.mocap_quat[mocap], direction)


def _tool_xml(skin: str) -> str:
    """The tool in its own frame: the cup's mouth looks along x, the rod leans back to the hand."""
    dark = rgba((0.10, 0.10, 0.11))
    tip = CUP_DEPTH / 2
    cup = geom("box", (0.006, CUP_HALF_WIDTH + 0.010, 0.019), (-0.006, 0, 0.021), dark)
    for side in (-1, 1):
        cup += geom("box", (tip, 0.005, 0.019), (tip, side * (CUP_HALF_WIDTH + 0.005), 0.021), dark)
    fingers = "".join(
        geom("capsule", (0.0095, 0.019), (0.017, 0.004, _GRIP + d), skin, euler="90 0 0")
        for d in (-0.036, -0.016, 0.004, 0.024)
    )
    hand = (
        fingers
        + geom("ellipsoid", (0.024, 0.026, 0.046), (-0.012, 0, _GRIP), skin)
        + geom("capsule", (0.010, 0.022), (0.006, 0.026, _GRIP - 0.038), skin, euler="20 0 0")
        + geom("capsule", (0.024, 0.02), (-0.008, 0, _GRIP + 0.035), skin)
    )
    rod = geom("capsule", (0.008, 0.14), (0, 0, 0.145), 'material="rod"')
    tilt = -np.degrees(_ROD_TILT)
    return f'{cup}<body pos="-0.004 0 0.02" euler="0 {tilt:.2f} 0">{rod}{hand}</body>'


def _operator_xml(sleeve: str, skin: str) -> str:
    hair = rgba((0.12, 0.09, 0.07))
    torso = (
        geom("ellipsoid", (0.21, 0.13, 0.36), (0, -0.70, 0.10), sleeve)
        + geom("ellipsoid", (0.20, 0.10, 0.08), (0, -0.68, 0.36), sleeve)
        + geom("capsule", (0.05, 0.05), (0, -0.67, 0.45), skin)
        + geom("ellipsoid", (0.078, 0.095, 0.115), (0, -0.63, 0.60), skin)
        + geom("ellipsoid", (0.085, 0.095, 0.095), (0, -0.66, 0.65), hair)
        + geom("capsule", (0.055, 0.15), (-0.22, -0.60, 0.20), sleeve, euler="-20 10 0")
        + geom("capsule", (0.042, 0.12), (-0.24, -0.44, 0.045), sleeve, euler="75 0 0")
        + geom("ellipsoid", (0.04, 0.06, 0.02), (-0.24, -0.30, 0.02), skin)
    )
    forearm = geom("capsule", (0.027, 0.06), (0, 0, 0.06), skin) + geom(
        "capsule", (0.040, 0.105), (0, 0, _FOREARM - 0.10), sleeve
    )
    upper = geom("capsule", (0.050, _UPPER_ARM / 2), (0, 0, _UPPER_ARM / 2), sleeve)
    return (
        f'<body name="torso" mocap="true">{torso}</body>'
        f'<body name="forearm" mocap="true">{forearm}</body>'
        f'<body name="upper_arm" mocap="true">{upper}</body>'
    )


def _room_xml(rng: np.random.Generator, table: str) -> str:
    room = [
        geom("box", (0.62, 0.40, 0.014), (0, 0, -0.0145), f'material="{table}"'),
        geom("box", (2.6, 2.4, 0.02), (0, 0, -0.76), 'material="carpet"'),
        geom("box", (2.6, 0.02, 1.5), (0, 2.0, 0.7), 'material="plaster"'),
        geom("box", (2.6, 0.02, 1.5), (0, -2.4, 0.7), 'material="plaster"'),
        geom("box", (0.02, 2.4, 1.5), (-2.2, 0, 0.7), 'material="plaster"'),
        geom("box", (0.02, 2.4, 1.5), (2.2, 0, 0.7), 'material="plaster"'),
        geom("box", (0.55, 0.01, 0.45), (0.6, 1.97, 0.75), 'material="window"'),
        geom("box", (0.40, 0.18, 0.55), (-1.4, 1.75, -0.20), rgba((0.72, 0.70, 0.66))),
        geom("box", (0.30, 0.30, 0.28), (1.55, 0.9, -0.47), rgba((0.42, 0.40, 0.38))),
        geom("box", (0.20, 0.45, 0.30), (-1.7, -0.6, -0.45), rgba((0.30, 0.33, 0.38))),
        geom("box", (0.24, 0.04, 0.30), (0.05, -0.98, 0.0), rgba((0.17, 0.17, 0.19))),
    ]
    for x, y in ((-0.57, -0.35), (0.57, -0.35), (-0.57, 0.35), (0.57, 0.35)):
        room.append(geom("box", (0.02, 0.02, 0.36), (x, y, -0.385), rgba((0.25, 0.25, 0.27))))
    for index in range(7):  # folders on the cupboard
        at = (-1.68 + 0.085 * index, 1.72, 0.47 + 0.01 * rng.uniform(-1, 1))
        colour = THING_COLOURS[rng.integers(len(THING_COLOURS))]
        room.append(geom("box", (0.036, 0.12, 0.12), at, rgba([0.75 * channel for channel in colour])))
    return "".join(room)


def _scene_xml(
    push: Push,
    views: Sequence[View],
    things: Sequence[Thing],
    target_colour: tuple[float, float, float],
    size: tuple[int, int],
    rng: np.random.Generator,
) -> str:
    table = str(rng.choice(TABLES))
    sleeve, skin = (rgba(choices[rng.integers(4)]) for choices in (_SLEEVES, _SKINS))
    sun = rng.uniform(0.40, 0.50)
    warmth = rng.uniform(0.90, 1.0)
    angle = rng.uniform(0, 2 * np.pi)
    lamp = (0.7 * math.cos(angle), 0.35 + 0.5 * math.sin(angle), 1.7)
    aim = (-lamp[0], -lamp[1], -lamp[2])
    yaw = np.degrees(push.target_yaw)
    return f"""
<mujoco>
  <statistic extent="1" center="0 0 0"/>
  <visual>
    <global offwidth="{size[0]}" offheight="{size[1]}"/>
    <quality offsamples="4" shadowsize="{max(256, round(1.6 * size[0]))}"
      numslices="16" numstacks="10" numquads="3"/>
    <map znear="0.3" zfar="6" shadowscale="0.7"/>
    <headlight active="0"/>
  </visual>
  <asset>{materials_xml()}</asset>
  <worldbody>
    <light pos="{numbers(*lamp)}" dir="{numbers(*aim)}" castshadow="true" cutoff="60" exponent="1"
      diffuse="{numbers(sun, sun * warmth, sun * warmth**2)}" ambient="0.30 0.30 0.30"
      specular="0.25 0.25 0.25"/>
    <light pos="0.6 1.8 1.2" dir="-0.3 -1 -0.6" castshadow="false" directional="true"
      diffuse="0.34 0.36 0.39" ambient="0.10 0.10 0.11" specular="0 0 0"/>
    {_room_xml(rng, table)}
    <body pos="{numbers(*push.target_xy, 0.0005)}" euler="0 0 {yaw:.2f}">
      {geom("box", (TARGET_HALF, TARGET_HALF, 0.0006), (0, 0, 0), rgba(target_colour))}
    </body>
    <body name="object" mocap="true">
      {geom("cylinder", (OBJECT_RADIUS, 0.030), (0, 0, 0.0305), rgba(OBJECT_COLOUR))}
    </body>
    <body name="tool" mocap="true">{_tool_xml(skin)}</body>
    {_operator_xml(sleeve, skin)}
    {"".join(thing_xml(thing) for thing in things)}
    {"".join(view.xml(f"view{index}") for index, view in enumerate(views))}
  </worldbody>
</mujoco>"""
