"""What every test gets: one thread a process, one GL backend looked for once, a scratch folder of its own."""

import os
from pathlib import Path

import pytest

from anyview.runtime.graphics import load_mujoco

ROOT = Path(__file__).parents[1]

os.environ.setdefault("OMP_NUM_THREADS", "1")
load_mujoco()


@pytest.fixture(scope="session")
def root() -> Path:
    """The root of the repository."""
    return ROOT


@pytest.fixture(autouse=True)
def scratch(tmp_path_factory, monkeypatch) -> Path:
    """An empty scratch folder, so that no test finds what another, or a real run, has left."""
    folder = tmp_path_factory.mktemp("scratch")
    monkeypatch.setenv("ANYVIEW_SCRATCH", str(folder))
    return folder
