"""What `anyview doctor` looks at: is this machine fit for the active profile, and what to do if not."""

import importlib.metadata
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import joblib
import psutil

from anyview.cli.profiles import active_profile
from anyview.config import Params, load_params
from anyview.runtime.device import worker_count
from anyview.runtime.errors import AnyviewError
from anyview.runtime.graphics import BACKENDS, MISSING, probe
from anyview.runtime.scratch import scratch_root, scratch_size

# Measured: bytes of a stored simulated pixel (FFV1), of a raw webcam pixel (MJPG), of everything else.
_STORED_PIXEL = 0.35
_RAW_PIXEL = 0.25
_OTHER = 0.5e9
_RAW_FRAMES = 120

_TORCH = "import torch; print(torch.cuda.get_device_name() if torch.cuda.is_available() else 'cpu')"


@dataclass(frozen=True)
class Check:
    """One thing that was looked at; ``advice`` says what to do and is empty where all is well."""

    name: str
    found: str
    advice: str = ""


def examine() -> list[Check]:
    """Look at everything, from the root of the repository."""
    checks = [_python(), _graphics(), _device(), _dvc(), _git(), _cores()]
    try:
        params = load_params()
        profile = active_profile()
    except AnyviewError as error:
        return [*checks, Check("params", "unusable", str(error))]
    return [*checks, Check("profile", profile or "none: params.yaml has values of its own"), *_disk(params)]


def disk_needed(params: Params) -> tuple[float, float]:
    """Bytes that a run needs in the repository (DVC's cache and workspace) and in the scratch folder."""
    size = params.sim.image_size
    pixels = sum(each.demos for each in params.simulate.sets.values()) * 50 * size * size
    film = params.real.film
    clips = 2 * film.pairs + film.singles + 2 * film.extreme_pairs
    raw = clips * _RAW_FRAMES * film.width * film.width * 9 / 16
    small = clips * params.real.ingest.frames * params.real.ingest.size**2
    render = params.real.render
    pixels += 2 * render.demonstrations * (1 + render.moments) * params.real.ingest.size**2
    return 2 * (pixels * _STORED_PIXEL + raw * _RAW_PIXEL) + _OTHER, (pixels + small) * 3 + _OTHER


def _python() -> Check:
    version = ".".join(map(str, sys.version_info[:3]))
    return Check("python", version, "" if sys.version_info >= (3, 11) else "install Python 3.11 or newer")


def _graphics() -> Check:
    errors = {}
    for backend in BACKENDS:
        if not (error := probe(backend)):
            return Check("opengl", f"{backend}, headless")
        errors[backend] = error
    return Check("opengl", "; ".join(f"{name}: {error}" for name, error in errors.items()), MISSING)


def _device() -> Check:
    wish = os.environ.get("ANYVIEW_DEVICE", "auto")
    done = subprocess.run([sys.executable, "-c", _TORCH], capture_output=True, text=True)
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["PyTorch cannot be imported"])[-1]
        return Check("device", last, "run `make setup`")
    device = done.stdout.strip()
    found = f"{device} (PyTorch {_version('torch')}, ANYVIEW_DEVICE={wish})"
    if wish not in ("auto", "cpu", "cuda"):
        return Check("device", found, "set ANYVIEW_DEVICE to auto, cpu or cuda")
    if wish == "cuda" and device == "cpu":
        return Check("device", found, "set ANYVIEW_DEVICE to auto, or install a CUDA build of PyTorch")
    return Check("device", found)


def _dvc() -> Check:
    version = _version("dvc")
    if not version:
        return Check("dvc", "not installed", "run `make setup`")
    if not Path(".dvc/config").is_file():
        return Check("dvc", f"{version}, no repository here", "run from the root of a clone of Anyview")
    if not str(Path.cwd()).isascii():
        advice = "move the clone to a path of ASCII letters: DVC's queue fails here (all else works)"
        return Check("dvc", f"{version}, in a path with letters outside ASCII", advice)
    return Check("dvc", version)


def _git() -> Check:
    program = shutil.which("git")
    if program is None:
        return Check("git", "not installed", "install git")
    done = subprocess.run([program, "describe", "--always", "--dirty"], capture_output=True, text=True)
    if done.returncode:
        return Check("git", "no repository here", "clone Anyview with git: DVC compares revisions")
    return Check("git", f"revision {done.stdout.strip()}")


def _cores() -> Check:
    memory = psutil.virtual_memory().total
    backend = os.environ.get("ANYVIEW_BACKEND", "local")
    try:
        found = f"{joblib.cpu_count()}, {worker_count()} workers ({backend}), {_size(memory)} of memory"
    except AnyviewError as error:
        return Check("cores", str(joblib.cpu_count()), str(error))
    advice = "" if memory > 6e9 else "set ANYVIEW_WORKERS=1: a worker may need 3 GB"
    return Check("cores", found, advice)


def _disk(params: Params) -> list[Check]:
    repository, scratch = disk_needed(params)
    scratch = max(scratch - scratch_size(), 0)
    root = scratch_root()
    there = next(folder for folder in (root, *root.parents) if folder.is_dir())
    if there.stat().st_dev == Path().stat().st_dev:
        repository = scratch = repository + scratch
    return [
        _room("disk", Path(), repository, "free some space or use a smaller profile"),
        _room("scratch", there, scratch, "run `anyview clean` or set ANYVIEW_SCRATCH to another disk", root),
    ]


def _room(name: str, folder: Path, needed: float, advice: str, shown: Path | None = None) -> Check:
    free = shutil.disk_usage(folder).free
    where = f"{shown} holds {_size(scratch_size())}, " if shown else ""
    return Check(name, f"{where}{_size(free)} free, {_size(needed)} needed", "" if free > needed else advice)


def _size(count: float) -> str:
    return f"{count / 1e9:.1f} GB"


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return ""
