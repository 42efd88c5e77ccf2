import os
import subprocess
import sys

import pytest

from anyview.runtime.graphics import BACKENDS, find_backend, probe

# A library path with nothing in it stands for a machine without OpenGL: neither EGL nor OSMesa can be loaded.
NO_GL = """
import ctypes.util
import ctypes
real = ctypes.CDLL
def refuse(name, *arguments, **options):
    if name and any(part in str(name) for part in ("EGL", "OSMesa", "libGL")):
        raise OSError(f"{name}: cannot open shared object file")
    return real(name, *arguments, **options)
ctypes.CDLL = ctypes.cdll._dlltype = refuse
"""


def python(script: str, **environment: str) -> subprocess.CompletedProcess[str]:
    clean = {name: value for name, value in os.environ.items() if name not in ("ANYVIEW_GL", "MUJOCO_GL")}
    return subprocess.run(
        [sys.executable, "-c", script], env=clean | environment, capture_output=True, text=True
    )


@pytest.fixture
def no_gl(tmp_path) -> dict[str, str]:
    """Environment in which Python finds no OpenGL library."""
    (tmp_path / "sitecustomize.py").write_text(NO_GL)
    return {"PYTHONPATH": str(tmp_path)}


def test_a_backend_is_found_and_renders():
    backend = find_backend()
    assert backend in BACKENDS
    assert probe(backend) == ""


def test_a_probe_says_why_not():
    assert "nonsense" in probe("nonsense")


def test_the_choice_is_made_once_and_inherited():
    script = "import os, anyview.pusher, mujoco; mujoco.GLContext(8, 8); print(os.environ['ANYVIEW_GL'])"
    first = python(script)
    assert first.stdout.strip() in BACKENDS, first.stderr
    second = python(script, ANYVIEW_GL=first.stdout.strip(), MUJOCO_GL="nonsense")
    assert second.stdout == first.stdout


RENDERERS = {
    "the pusher": 'from anyview.pusher.render import renderer; renderer("push", 64)',
    "MuJoCo's own": (
        "from anyview.runtime.graphics import load_mujoco; mujoco = load_mujoco();"
        "mujoco.Renderer(mujoco.MjModel.from_xml_string('<mujoco/>'), 8, 8)"
    ),
}


@pytest.mark.parametrize("name", RENDERERS)
def test_whoever_renders_without_opengl_is_told_what_to_install(no_gl, name):
    script = (
        f"from anyview.runtime.errors import run_stage\ndef main(_):\n    {RENDERERS[name]}\nrun_stage(main)"
    )
    done = python(script, **no_gl)
    assert done.returncode == 2
    assert done.stderr.startswith("error: no headless OpenGL works here (tried EGL and OSMesa); on Debian")
    assert done.stderr.count("\n") == 1


def test_physics_needs_no_opengl(no_gl):
    done = python("import anyview.pusher.batch; print('imported')", **no_gl)
    assert done.stdout == "imported\n", done.stderr


def test_the_module_reports_for_the_makefile(no_gl):
    done = subprocess.run(
        [sys.executable, "-m", "anyview.runtime.graphics"], capture_output=True, text=True, env=os.environ
    )
    assert done.returncode == 0
    assert done.stdout.startswith("headless OpenGL: ")
    done = subprocess.run(
        [sys.executable, "-m", "anyview.runtime.graphics"], capture_output=True, env=os.environ | no_gl
    )
    assert done.returncode == 2
