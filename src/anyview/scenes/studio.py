"""The studio: draws a scene for two cameras in one OpenGL context that is made once a process.

Shapes are written into MuJoCo's list of things to draw; there is no model to compile and no physics to run.
Both pictures are the two halves of one stereo pair, so that a moment costs one call. There is no hardware
multisampling, slow in software: pictures are meant to be shrunk.
"""

import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from anyview.runtime.graphics import load_mujoco
from anyview.scenes.shapes import Colour, Shape

mujoco = load_mujoco()

TEXTURES = 3  # slots
TEXTURE_SIZE = 256

_MOST_SHAPES = 400
_NEAR, _FAR = 0.05, 12.0  # metres
_XML = f"""
<mujoco>
  <statistic extent="1" center="0 0 0"/>
  <visual>
    <global offwidth="{{width}}" offheight="{{height}}"/>
    <quality offsamples="0" shadowsize="384" numslices="10" numstacks="5" numquads="2"/>
    <map znear="{_NEAR}" zfar="{_FAR}" shadowscale="0.7"/>
  </visual>
  <asset>{{textures}}</asset>
</mujoco>"""
_OFF = ("mjRND_REFLECTION", "mjRND_SKYBOX", "mjRND_HAZE", "mjRND_FOG")


@dataclass(frozen=True)
class Camera:
    """A pinhole camera with a square picture."""

    position: np.ndarray  # (3,)
    forward: np.ndarray  # (3,), of unit length, as is ``up``
    up: np.ndarray  # (3,)
    field: float  # radians, of the picture's height

    def project(self, points: np.ndarray) -> np.ndarray:
        """Where ``points`` (N, 3) are seen, (N, 2): x to the right and y down, -1 to 1 within the picture."""
        gap = points - self.position
        right = np.cross(self.forward, self.up)
        depth = (gap * self.forward).sum(axis=1)
        across = np.stack([(gap * right).sum(axis=1), -(gap * self.up).sum(axis=1)], axis=1)
        return across / (depth[:, None] * math.tan(0.5 * self.field))


@dataclass(frozen=True)
class Light:
    """A lamp: a spot where ``cutoff`` is given, in degrees, else as far as the sun."""

    position: np.ndarray  # (3,), looking at the scene's centre
    diffuse: Colour
    ambient: Colour
    specular: float
    cutoff: float | None
    exponent: float
    casts_shadow: bool


class Studio:
    """Draws square pictures of ``size`` pixels. Use ``studio(size)``, which shares one a thread."""

    def __init__(self, size: int):
        texture = (
            f'<texture name="{{}}" type="2d" builtin="flat" width="{TEXTURE_SIZE}" height="{TEXTURE_SIZE}"/>'
        )
        textures = "".join(texture.format(f"slot{slot}") for slot in range(TEXTURES))
        self._size = size
        self._model = mujoco.MjModel.from_xml_string(
            _XML.format(width=2 * size, height=size, textures=textures)
        )
        self._gl = mujoco.GLContext(2 * size, size)
        self._gl.make_current()
        self._context = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._scene = mujoco.MjvScene(self._model, maxgeom=_MOST_SHAPES)
        self._scene.stereo = mujoco.mjtStereo.mjSTEREO_SIDEBYSIDE
        for flag in _OFF:
            self._scene.flags[getattr(mujoco.mjtRndFlag, flag)] = 0
        self._rect = mujoco.MjrRect(0, 0, 2 * size, size)
        self._pixels = np.empty((size, 2 * size, 3), np.uint8)
        self._standing = 0

    def arrange(
        self,
        shapes: Sequence[Shape],
        lights: Sequence[Light],
        cameras: Sequence[Camera],
        textures: Sequence[np.ndarray],
    ) -> None:
        """Set up a scene: what stands still, lights, two cameras, uint8 textures (256, 256, 3)."""
        self._gl.make_current()
        for slot, texture in enumerate(textures):
            first = self._model.tex_adr[slot]
            self._model.tex_data[first : first + texture.size] = texture.ravel()
            mujoco.mjr_uploadTexture(self._model, self._context, slot)
        for eye, camera in zip(self._scene.camera, cameras, strict=True):
            eye.pos, eye.forward, eye.up = camera.position, camera.forward, camera.up
            eye.frustum_near, eye.frustum_far, eye.frustum_center = _NEAR, _FAR, 0.0
            eye.frustum_top = _NEAR * math.tan(0.5 * camera.field)
            eye.frustum_bottom, eye.frustum_width = -eye.frustum_top, 0.0  # 0: as wide as it is high
            eye.orthographic = 0
        for lamp, light in zip(self._scene.lights, lights, strict=False):
            _set_light(lamp, light)
        self._scene.nlight = len(lights)
        self._write(shapes, 0)
        self._standing = len(shapes)

    def shoot(self, moving: Sequence[Shape]) -> np.ndarray:
        """Both cameras' pictures, uint8 RGB (2, size, size, 3), of the scene with what moves where it is."""
        self._gl.make_current()
        self._write(moving, self._standing)
        mujoco.mjr_render(self._rect, self._scene, self._context)
        mujoco.mjr_readPixels(self._pixels, None, self._rect, self._context)
        return np.stack([self._pixels[::-1, : self._size], self._pixels[::-1, self._size :]])

    def _write(self, shapes: Sequence[Shape], first: int) -> None:
        for geom, shape in zip(self._scene.geoms[first:], shapes, strict=False):
            surface = shape.surface
            kind = getattr(mujoco.mjtGeom, f"mjGEOM_{shape.kind}")
            colour = np.array([*surface.colour, 1.0], np.float32)
            mujoco.mjv_initGeom(geom, kind, np.array(shape.size), shape.position, shape.turn.ravel(), colour)
            # What mjv_initGeom leaves as the memory happened to be, and differs between processes.
            geom.category, geom.objtype = mujoco.mjtCatBit.mjCAT_STATIC, mujoco.mjtObj.mjOBJ_UNKNOWN
            geom.objid, geom.segid, geom.transparent, geom.camdist, geom.modelrbound = -1, -1, 0, 0.0, 0.0
            geom.specular, geom.shininess = surface.specular, surface.shininess
            geom.castshadow = surface.casts_shadow
            geom.texid = -1 if surface.texture is None else surface.texture
            geom.matid = geom.texid
            geom.texrepeat = surface.repeats, surface.repeats
        self._scene.ngeom = first + len(shapes)


def _set_light(lamp: Any, light: Light) -> None:
    """Write ``light`` into MuJoCo's ``lamp``."""
    kinds = mujoco.mjtLightType
    lamp.type = kinds.mjLIGHT_DIRECTIONAL if light.cutoff is None else kinds.mjLIGHT_SPOT
    lamp.headlight, lamp.texid, lamp.castshadow = 0, -1, light.casts_shadow
    lamp.pos = light.position
    lamp.dir = -light.position / math.hypot(*light.position)
    lamp.diffuse, lamp.ambient, lamp.specular = light.diffuse, light.ambient, [light.specular] * 3
    lamp.cutoff, lamp.exponent = light.cutoff or 90.0, light.exponent
    lamp.attenuation, lamp.range, lamp.bulbradius = (1.0, 0.0, 0.0), _FAR, 0.02


class _Studios(threading.local):
    """Each thread's studios: an OpenGL context belongs to the thread that made it."""

    def __init__(self) -> None:
        self.by_size: dict[int, Studio] = {}


_studios = _Studios()


def studio(size: int) -> Studio:
    """This thread's studio for pictures of ``size`` pixels."""
    if size not in _studios.by_size:
        _studios.by_size[size] = Studio(size)
    return _studios.by_size[size]
