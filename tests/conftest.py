"""What every test gets: one thread a process, one GL backend looked for once, a scratch folder of its own."""

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from anyview.runtime.graphics import load_mujoco

ROOT = Path(__file__).parents[1]

os.environ.setdefault("OMP_NUM_THREADS", "1")
load_mujoco()
# A shell that starts tests in the background makes them ignore Ctrl-C, and their children with them.
signal.signal(signal.SIGINT, signal.default_int_handler)


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


def copy_of_the_repository(folder: Path) -> Path:
    """A clone with what is not committed yet: the files that git does not ignore, in a new repository."""

    def listed(*which: str) -> list[str]:
        command = ["git", "ls-files", "-z", *which, "--exclude-standard"]
        done = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True)
        return done.stdout.split("\0")[:-1]

    new = [name for name in listed("--others") if not name.startswith("data/")]  # data is DVC's
    for name in [*listed("--cached"), *new]:
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    git = [
        "git",
        "-c",
        "user.name=test",
        "-c",
        "user.email=test@example.org",
        "-c",
        "core.hooksPath=/dev/null",
    ]
    for command in (["init", "-q", "-b", "main"], ["add", "-A"], ["commit", "-q", "-m", "start"]):
        subprocess.run([*git, *command], cwd=folder, check=True)
    return folder


class Study:
    """A repository in which to run things, as a user would, with a scratch folder of its own."""

    def __init__(self, folder: Path, scratch: Path):
        self.folder, self.scratch = folder, scratch

    def start(self, *command: str, **environment: str) -> subprocess.Popen[str]:
        """Start ``command``, a program of the environment's, in a process group of its own."""
        path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
        return subprocess.Popen(
            [shutil.which(command[0], path=path) or command[0], *command[1:]],
            cwd=self.folder,
            env=os.environ
            | {
                "PATH": path,
                "PYTHONPATH": str(self.folder / "src"),
                "ANYVIEW_SCRATCH": str(self.scratch),
                "NO_COLOR": "1",
            }
            | environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def run(self, *command: str, **environment: str) -> str:
        """Run ``command`` to its end, which must be a good one. Returns what it printed."""
        process = self.start(*command, **environment)
        said, complaint = process.communicate()
        assert process.returncode == 0, f"{' '.join(command)}\n{said[-4000:]}\n{complaint[-4000:]}"
        return said


@pytest.fixture(scope="session")
def smoke(tmp_path_factory) -> Study:
    """The whole pipeline at the `smoke` profile, run once for all tests by the real `dvc repro`."""
    study = Study(
        copy_of_the_repository(tmp_path_factory.mktemp("study")), tmp_path_factory.mktemp("scratch")
    )
    study.run("anyview", "profile", "smoke")
    study.run("dvc", "repro")
    return study
