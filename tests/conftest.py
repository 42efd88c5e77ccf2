"""What every test gets: one thread a process, one GL backend looked for once, a scratch folder of its own."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest
from filelock import FileLock
from hypothesis import settings

from anyview.runtime.graphics import load_mujoco
from tests.long_stages import LONG_STAGES, change, digests

ROOT = Path(__file__).parents[1]
pytest_plugins = ("tests.expert_clips", "tests.small_trainings")  # fixtures of several folders

os.environ.setdefault("OMP_NUM_THREADS", "1")
load_mujoco()
# A shell that starts tests in the background makes them ignore Ctrl-C, and their children with them.
signal.signal(signal.SIGINT, signal.default_int_handler)
# A machine may be busy, and where CI is set, as .ci/run does, hypothesis always tries the same examples.
settings.register_profile("patient", deadline=None)
settings.load_profile("patient")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files whose tests need the whole pipeline come first: they take longest."""
    items.sort(key=lambda item: "smoke" not in getattr(item, "fixturenames", ()))


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
        if (ROOT / name).is_file() or (ROOT / name).is_symlink():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name, follow_symlinks=False)
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

    def copy(self, folder: Path) -> "Study":
        """The same study in the new ``folder``, with an empty scratch folder."""
        left_out = shutil.ignore_patterns(".venv", "tmp")
        shutil.copytree(self.folder, folder / "study", symlinks=True, ignore=left_out)
        return Study(folder / "study", folder / "scratch")

    def clone(self, folder: Path) -> "Study":
        """A second machine: what Git has, an empty DVC cache, an empty scratch folder."""
        self.run("git", "add", "-A")
        self.run(
            "git", "-c", "user.name=a", "-c", "user.email=a@example.org", "commit", "-q", "-m", "results"
        )
        self.run("git", "clone", "-q", str(self.folder), str(folder))
        return Study(folder, folder.with_name("other-scratch"))


@pytest.fixture(scope="session")
def trunk(tmp_path_factory) -> Study:
    """The `smoke` profile as far as the clips and the first policy: what single stages need to run."""

    def build(folder: Path) -> Study:
        study = Study(copy_of_the_repository(folder / "study"), folder / "scratch")
        study.run("anyview", "profile", "smoke")
        study.run("dvc", "repro", "ingest", "imitate@ours")
        return study

    return built_once(tmp_path_factory, "trunk", build)


@pytest.fixture(scope="session")
def smoke(trunk, tmp_path_factory) -> Study:
    """The whole pipeline at the `smoke` profile, run once for all tests by the real `dvc repro`."""

    def build(folder: Path) -> Study:
        study = trunk.copy(folder)
        study.run("dvc", "repro")
        return study

    return built_once(tmp_path_factory, "smoke", build)


def built_once(tmp_path_factory: pytest.TempPathFactory, name: str, build: Callable[[Path], Study]) -> Study:
    """A copy of what the first of the processes that share the tests has built in a folder of all."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / name
    with FileLock(f"{folder}.lock"):
        if not (folder / "built").exists():
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            build(folder)
            (folder / "built").touch()
    return Study(folder / "study", folder / "scratch").copy(tmp_path_factory.mktemp(name))


@pytest.fixture
def study(trunk, tmp_path) -> Study:
    """A copy of the trunk to change and to run stages in."""
    return trunk.copy(tmp_path)


@pytest.fixture(scope="session")
def undisturbed(trunk, tmp_path_factory) -> Callable[[str], tuple[dict[str, str], float]]:
    """What a long stage makes by one worker that nobody stops, and how many seconds it takes."""

    @cache
    def run(name: str) -> tuple[dict[str, str], float]:
        stage = LONG_STAGES[name]
        study = trunk.copy(tmp_path_factory.mktemp(name))
        change(study.folder, stage.params)
        began = time.monotonic()
        study.run("python", *stage.command, ANYVIEW_WORKERS="1")
        return digests(study.folder / stage.output), time.monotonic() - began

    return run
