"""Headless OpenGL for MuJoCo: EGL, else OSMesa, chosen by rendering one frame in a process of its own."""

import os
import subprocess
import sys
from types import ModuleType

from anyview.runtime.errors import BAD_INPUT, AnyviewError

BACKENDS = ("egl", "osmesa")
MISSING = (
    "no headless OpenGL works here (tried EGL and OSMesa); "
    "on Debian or Ubuntu: apt-get install libegl1 libopengl0 libgl1-mesa-dri libosmesa6"
)

_PROBE = """
import mujoco
model = mujoco.MjModel.from_xml_string(
    "<mujoco><worldbody><light pos='0 0 2'/><geom type='plane' size='1 1 1'/></worldbody></mujoco>"
)
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with mujoco.Renderer(model, 32, 32) as renderer:
    renderer.update_scene(data)
    assert renderer.render().max() > 0, "the frame is black"
"""


def probe(backend: str) -> str:
    """Render a frame with ``backend`` in a new process. Returns "" if it works, else what went wrong."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", _PROBE],
            env={**os.environ, "MUJOCO_GL": backend},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=120,
        )
    except subprocess.TimeoutExpired:
        return "no frame after 120 s"
    lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
    return "" if done.returncode == 0 else lines[-1]


def find_backend() -> str | None:
    """The first backend that renders, the one that ``MUJOCO_GL`` names before others; None if none does."""
    wish = os.environ.get("MUJOCO_GL")
    return next((name for name in sorted(BACKENDS, key=lambda name: name != wish) if not probe(name)), None)


class NoGraphics:
    """Stands for ``mujoco.GLContext`` where no backend works: whoever renders is told what to install."""

    def __init__(self, width: int, height: int):
        raise AnyviewError(MISSING)


def load_mujoco() -> ModuleType:
    """Import ``mujoco`` with a headless OpenGL. Must come before any other import of it in the process.

    ``ANYVIEW_GL`` keeps the choice for child processes, which then need not look again. Where no backend
    works, physics runs, and rendering raises AnyviewError saying what is missing. Software rendering stays
    in the calling thread, since workers already keep every core busy.
    """
    if os.environ.get("ANYVIEW_GL") not in (*BACKENDS, "disabled"):
        os.environ["ANYVIEW_GL"] = find_backend() or "disabled"
    os.environ["MUJOCO_GL"] = os.environ["ANYVIEW_GL"]
    os.environ.setdefault("LP_NUM_THREADS", "0")
    import mujoco

    if os.environ["ANYVIEW_GL"] == "disabled":
        from mujoco.rendering.classic import gl_context  # where `mujoco.Renderer` looks

        mujoco.GLContext = gl_context.GLContext = NoGraphics
    return mujoco


if __name__ == "__main__":
    found = find_backend()
    if found is None:
        print(f"error: {MISSING}", file=sys.stderr)
        sys.exit(BAD_INPUT)
    print(f"headless OpenGL: {found}")
