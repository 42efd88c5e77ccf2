import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from anyview.runtime.errors import AnyviewError, choose_each, exit_code


def raising(error: BaseException):
    def action():
        raise error

    return action


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (AnyviewError("a.yaml: b.c:\n  unknown key"), 2, "error: a.yaml: b.c: unknown key\n"),
        (
            FileNotFoundError(2, "No such file or directory", "x.csv"),
            2,
            "error: x.csv: No such file or directory\n",
        ),
        (KeyboardInterrupt(), 130, "interrupted\n"),
        (AnyviewError("x" * 1_000_000), 2, f"error: {'x' * 2000}\n"),
        (
            MemoryError(),
            2,
            "error: not enough memory; ask for less in params.yaml, or set fewer ANYVIEW_WORKERS\n",
        ),
    ],
)
def test_a_user_error_is_one_line_and_a_code(capsys, error, code, said):
    assert exit_code(raising(error)) == code
    assert capsys.readouterr() == ("", said)


def test_a_full_disk_says_what_to_do(capsys):
    assert exit_code(raising(OSError(28, "No space left on device"))) == 2
    assert (
        "No space left on device; free some space and run the same command again" in capsys.readouterr().err
    )


@pytest.mark.parametrize("error", [ZeroDivisionError(), OSError("no errno: somebody else's error")])
def test_our_own_mistakes_are_not_hidden(error):
    with pytest.raises(type(error)):
        exit_code(raising(error))


def test_done_is_zero():
    assert exit_code(lambda: None) == 0


def stage(body: str, *arguments: str, **options) -> subprocess.Popen[str]:
    """A process that runs ``body`` as a stage's ``main(arguments)``."""
    head = "import os, sys, time\nfrom pathlib import Path\nfrom anyview.runtime.errors import *\n"
    script = head + "def main(arguments):\n" + "".join(f"    {line}\n" for line in body.splitlines())
    return subprocess.Popen(
        [sys.executable, "-c", script + "run_stage(main)", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )


def test_a_stage_gets_its_arguments():
    process = stage("print(arguments)", "sim", "--all")
    assert process.communicate() == ("['sim', '--all']\n", "")
    assert process.returncode == 0


def test_a_reader_that_stops_early_is_no_error():
    process = stage("for _ in range(100_000): print('line')")
    assert process.stdout is not None
    process.stdout.readline()
    process.stdout.close()
    assert process.wait() == 0
    assert process.stderr is not None
    assert process.stderr.read() == ""


HOLD = """from anyview.runtime.outputs import whole_folder
with whole_folder(Path(arguments[0])) as folder:
    (folder / 'half').touch()
    print('ready', flush=True)
    time.sleep(60)"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_stopped_stage_cleans_up(tmp_path, number):
    process = stage(HOLD, str(tmp_path / "cell"))
    assert process.stdout is not None
    process.stdout.readline()
    process.send_signal(number)
    _, said = process.communicate(timeout=180)
    assert process.returncode == 130
    assert said == "interrupted: run the same command again to continue\n"
    assert os.listdir(tmp_path) == []


def test_ctrl_c_with_workers_at_work_is_one_line(tmp_path):
    """A terminal sends SIGINT to the whole group: the stage and its workers."""
    body = f"""from anyview.runtime.workers import run_tasks
sys.path.insert(0, {str(Path(__file__).parent)!r})
from tasks import hold
for _ in run_tasks(hold, [(arguments[0], n) for n in range(4)]): pass"""
    process = stage(body, str(tmp_path), start_new_session=True, env={**os.environ, "ANYVIEW_WORKERS": "2"})
    deadline = time.monotonic() + 180
    while len(os.listdir(tmp_path)) < 2 and time.monotonic() < deadline:
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=180)
    assert (process.returncode, said) == (130, "interrupted: run the same command again to continue\n")


def test_a_stopped_stage_waits_for_nobody():
    """Not for a thread, which may be a pool's that hangs."""
    body = """import threading
threading.Thread(target=time.sleep, args=(600,)).start()
print('ready', flush=True)
time.sleep(600)"""
    process = stage(body)
    assert process.stdout is not None
    process.stdout.readline()
    process.terminate()
    _, said = process.communicate(timeout=180)
    assert (process.returncode, said) == (130, "interrupted: run the same command again to continue\n")


def test_each_argument_is_one_of_its_own_choices():
    choices = {"CELL": ["sim", "tcn"], "SEED": [1, 2]}
    assert choose_each(["tcn", "2"], choices, "train.py") == ["tcn", "2"]
    for arguments, said in (
        ([], "usage: python train.py CELL, where CELL is one of sim, tcn"),
        (["gail", "1"], "usage: python train.py CELL, where CELL is one of sim, tcn"),
        (["sim"], "usage: python train.py CELL SEED, where SEED is one of 1, 2"),
        (["sim", "1", "2"], "usage: python train.py CELL SEED, where SEED is one of 1, 2"),
    ):
        with pytest.raises(AnyviewError) as caught:
            choose_each(arguments, choices, "train.py")
        assert str(caught.value) == said
