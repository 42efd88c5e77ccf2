"""The camera: frames of contexts by headless OpenGL, several times faster than ``mujoco.Renderer``.

What makes it fast: coarse meshes (a disc of 16 slices looks round at 64 pixels), no shadows, reflections, sky
or haze, no hardware multisampling (slow in software), and one scene whose few changing values are written in
place. A frame is rendered at twice its size and averaged, so that a shift of a fraction of a pixel shows.
"""

import copy
import threading
from collections.abc import Sequence

import cv2
import mujoco
import numpy as np

from anyview.pusher.contexts import Context
from anyview.pusher.scene import (
    ARENA_CENTRE,
    CAMERA_DISTANCE,
    CAMERA_ELEVATION,
    DISTRACTORS,
    GOAL_COLOURS,
)
from anyview.pusher.task import load_task

_SUPERSAMPLING = 2
_OFF = ("mjRND_SHADOW", "mjRND_REFLECTION", "mjRND_SKYBOX", "mjRND_HAZE", "mjRND_ADDITIVE", "mjRND_FOG")


class Renderer:
    """Renders square frames of one task and size. Use ``renderer``, which shares one a thread."""

    def __init__(self, task: str, image_size: int):
        self._size = image_size
        pixels = image_size * _SUPERSAMPLING
        self._model = copy.copy(load_task(task).model("twist"))
        self._model.vis.global_.offwidth = self._model.vis.global_.offheight = pixels
        self._data = mujoco.MjData(self._model)
        self._gl = mujoco.GLContext(pixels, pixels)
        self._gl.make_current()
        self._context = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._scene = mujoco.MjvScene(self._model, maxgeom=64)
        for flag in _OFF:
            self._scene.flags[getattr(mujoco.mjtRndFlag, flag)] = 0
        self._option = mujoco.MjvOption()
        self._camera = mujoco.MjvCamera()
        self._camera.lookat[:] = [*ARENA_CENTRE, 0.0]
        self._camera.distance = CAMERA_DISTANCE
        self._camera.elevation = CAMERA_ELEVATION
        self._rect = mujoco.MjrRect(0, 0, pixels, pixels)
        self._pixels = np.empty((pixels, pixels, 3), np.uint8)
        self._goals = [self._model.geom(name).id for name in GOAL_COLOURS]
        self._distractors = [self._model.geom(f"distractor{i}").id for i in range(DISTRACTORS)]

    def render(self, contexts: Sequence[Context], positions: np.ndarray) -> np.ndarray:
        """Frames (N, size, size, 3) uint8 RGB of ``contexts``, with arm and objects at ``positions``.

        These are (N, 3 + 2 k): three joint angles in radians, then x and y of each object in metres.
        """
        self._gl.make_current()
        frames = np.empty((len(contexts), self._size, self._size, 3), np.uint8)
        for context, position, frame in zip(contexts, positions, frames, strict=True):
            self._dress(context)
            self._shoot(position, frame)
        return frames

    def render_clip(self, context: Context, positions: np.ndarray) -> np.ndarray:
        """Frames (T, size, size, 3) of one context along ``positions`` (T, 3 + 2 k)."""
        self._gl.make_current()
        frames = np.empty((len(positions), self._size, self._size, 3), np.uint8)
        self._dress(context)
        for position, frame in zip(positions, frames, strict=True):
            self._shoot(position, frame)
        return frames

    def _dress(self, context: Context) -> None:
        self._model.geom_rgba[[*self._goals, *self._distractors], 3] = 0
        for geom, place in zip(self._goals, context.goals, strict=False):
            self._model.geom_pos[geom, :2] = place
            self._model.geom_rgba[geom, 3] = 1
        for geom, distractor in zip(self._distractors, context.distractors, strict=False):
            self._model.geom_pos[geom, :2] = distractor.position
            self._model.geom_rgba[geom, :3] = distractor.colour
            self._model.geom_rgba[geom, 3] = distractor.visible
        self._camera.azimuth = np.rad2deg(context.azimuth)

    def _shoot(self, position: np.ndarray, frame: np.ndarray) -> None:
        self._data.qpos[:] = position
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        mujoco.mjv_updateScene(
            self._model, self._data, self._option, None, self._camera, mujoco.mjtCatBit.mjCAT_ALL, self._scene
        )
        mujoco.mjr_render(self._rect, self._scene, self._context)
        mujoco.mjr_readPixels(self._pixels, None, self._rect, self._context)
        cv2.resize(self._pixels[::-1], (self._size, self._size), dst=frame, interpolation=cv2.INTER_AREA)


class _Renderers(threading.local):
    """Each thread's renderers: an OpenGL context belongs to the thread that made it."""

    def __init__(self) -> None:
        self.made: dict[tuple[str, int], Renderer] = {}


_renderers = _Renderers()


def renderer(task: str, image_size: int) -> Renderer:
    """This thread's renderer of ``task`` for ``image_size``."""
    if (task, image_size) not in _renderers.made:
        _renderers.made[task, image_size] = Renderer(task, image_size)
    return _renderers.made[task, image_size]
