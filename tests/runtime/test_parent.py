import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

TASKS = str(Path(__file__).parent)

STAGE = f"""
import os, sys, time
from pathlib import Path
sys.path.insert(0, {TASKS!r})
from anyview.runtime.errors import run_stage
from anyview.runtime.workers import run_tasks
from tasks import hold

def main(arguments):
    Path(arguments[0], "stage-" + str(os.getpid())).touch()
    list(run_tasks(hold, [(arguments[0], 0), (arguments[0], 1)]))

run_stage(main)
"""


@pytest.fixture
def folder(tmp_path) -> Path:
    (tmp_path / "stage.py").write_text(STAGE)
    (tmp_path / "pids").mkdir()
    return tmp_path


def running(folder: Path) -> list[int]:
    """Processes that left their id in ``folder`` and are still there."""
    found = (int(path.name.removeprefix("stage-")) for path in (folder / "pids").iterdir())
    return [pid for pid in found if psutil.pid_exists(pid) and not _zombie(pid)]


def _zombie(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


def wait(until, seconds: float = 180) -> None:
    deadline = time.monotonic() + seconds
    while not until():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.05)


def start(folder: Path, command: list[str], **environment: str) -> subprocess.Popen:
    """Run ``command`` and wait until a stage with two workers is at work below it."""
    process = subprocess.Popen(
        command,
        cwd=folder,
        env={**os.environ, "ANYVIEW_WORKERS": "2", **environment},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    wait(lambda: len(running(folder)) == 3)
    return process


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_workers_end_with_their_stage(folder, number):
    process = start(folder, [sys.executable, "stage.py", "pids"])
    process.send_signal(number)
    process.wait(180)
    wait(lambda: not running(folder))


def test_a_stage_ends_with_dvc_though_the_shell_between_them_lives(folder):
    """What ``dvc`` does: a shell that waits for the stage. The shell does not die with its parent."""
    shell = f"{sys.executable} stage.py pids; sleep 3600"
    dvc = f"import subprocess; subprocess.run(['/bin/sh', '-c', {shell!r}])"
    process = start(folder, [sys.executable, "-c", dvc], DVC_STAGE="train@sim")
    shells = psutil.Process(process.pid).children()
    process.kill()
    process.wait()
    try:
        wait(lambda: not running(folder))
        assert shells[0].is_running()
    finally:
        for child in [*shells[0].children(), *shells]:
            child.kill()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_no_orphan_of_a_killed_dvc(folder, number):
    """The real ``dvc repro``, killed alone; the next one can start at once."""
    dvc = [sys.executable, "-m", "dvc"]
    subprocess.run([*dvc, "init", "-q", "--no-scm"], cwd=folder, check=True)
    (folder / "dvc.yaml").write_text(f"stages: {{hold: {{cmd: {sys.executable} stage.py pids}}}}\n")
    process = start(folder, [*dvc, "repro"])
    process.send_signal(number)
    process.wait(180)
    wait(lambda: not running(folder))
    shutil.rmtree(folder / "pids")
    (folder / "pids").mkdir()
    (folder / "stage.py").write_text("print('done')")
    again = subprocess.run([*dvc, "repro"], cwd=folder, capture_output=True, text=True)
    assert again.returncode == 0, again.stderr


def test_no_worker_outlives_a_stage_killed_before_they_began(folder):
    """A worker that is still importing when the stage dies has nobody to hear of it later."""
    process = subprocess.Popen(
        [sys.executable, "stage.py", "pids"], cwd=folder, env={**os.environ, "ANYVIEW_WORKERS": "2"}
    )
    stage = psutil.Process(process.pid)

    def workers() -> list[psutil.Process]:
        return [child for child in stage.children() if any("popen_loky" in part for part in child.cmdline())]

    wait(lambda: len(workers()) == 2)
    started = workers()
    process.kill()
    process.wait()
    wait(lambda: not any(worker.is_running() and not _zombie(worker.pid) for worker in started))
