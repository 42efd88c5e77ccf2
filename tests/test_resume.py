"""Long stages, killed at random moments, continue and end with the bytes of an uninterrupted run."""

import os
import random
import runpy
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.conftest import Study
from tests.long_stages import LONG_STAGES, change, digests

# Of a stage at work; one that still imports modules ends as Python does.
EXIT_CODES = {signal.SIGKILL: -signal.SIGKILL, signal.SIGTERM: 130, signal.SIGINT: 130}


def checkpoints(scratch: Path) -> list[Path]:
    """Finished checkpoints and tasks."""
    return [path for path in scratch.rglob("checkpoints/*/*") if "partial" not in path.name]


def wait_for_a_checkpoint(study: Study, process: subprocess.Popen[str]) -> None:
    while not checkpoints(study.scratch):
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)


def stop(process: subprocess.Popen[str], number: signal.Signals) -> str:
    """Send a signal, Ctrl-C to the group as a terminal does; returns what was said on standard error."""
    if number == signal.SIGINT:
        os.killpg(process.pid, number)
    else:
        process.send_signal(number)
    return process.communicate(timeout=180)[1]


@pytest.fixture
def begun(study) -> Callable[..., subprocess.Popen[str]]:
    """Starts a command by two workers, with a checkpoint after every task."""

    def start(*command: str) -> subprocess.Popen[str]:
        return study.start(*command, ANYVIEW_CHECKPOINT_SECONDS="0", ANYVIEW_WORKERS="2")

    return start


@pytest.mark.slow
@pytest.mark.parametrize("name", LONG_STAGES)
def test_a_killed_stage_continues_to_the_same_bytes(study, begun, undisturbed, name):
    """Killed and continued by two workers, compared with one worker that nobody stopped.

    The first signal falls into the work for certain, the others at any moment from the start on.
    """
    stage = LONG_STAGES[name]
    expected, seconds = undisturbed(name)
    folder = study.folder / stage.output
    before = digests(folder)
    assert before != expected
    change(study.folder, stage.params)
    rng = random.Random(name)
    for turn, number in enumerate(rng.sample(list(EXIT_CODES), len(EXIT_CODES))):
        process = begun("python", *stage.command)
        if turn == 0:
            wait_for_a_checkpoint(study, process)
            complaint = stop(process, number)
            assert process.returncode == EXIT_CODES[number]
            assert "Traceback" not in complaint
        else:
            time.sleep(rng.random() * seconds * 0.6)
            stop(process, number)
        assert digests(folder) in (before, expected)  # an output stands or is replaced, both whole
    begun("python", *stage.command).communicate()
    assert digests(folder) == expected
    assert checkpoints(study.scratch) == []
    assert list((study.folder / "data").rglob(".*.partial")) == []


@pytest.mark.slow
def test_changed_params_start_afresh(study, begun, undisturbed):
    """A checkpoint of other params is not taken up."""
    stage = LONG_STAGES["train"]
    change(study.folder, stage.params)
    params = (study.folder / "params.yaml").read_text()
    change(study.folder, {"base.seed": 8})
    process = begun("python", *stage.command)
    wait_for_a_checkpoint(study, process)
    stop(process, signal.SIGKILL)
    (study.folder / "params.yaml").write_text(params)
    study.run("python", *stage.command)
    assert digests(study.folder / stage.output) == undisturbed("train")[0]


@pytest.mark.slow
def test_changed_code_starts_afresh(study, begun):
    """A checkpoint of other code is not taken up, whichever module it was."""
    stage = LONG_STAGES["train"]
    change(study.folder, stage.params)
    for number in (1, 2):
        process = begun("python", *stage.command)
        while len(list(study.scratch.glob("checkpoints/*/"))) < number:
            assert process.poll() is None, process.communicate()
            time.sleep(0.02)
        if number == 1:
            wait_for_a_checkpoint(study, process)
        stop(process, signal.SIGKILL)
        with (study.folder / "src/anyview/seeds.py").open("a") as file:
            file.write("# other streams\n")


@pytest.mark.slow
def test_a_killed_dvc_repro_continues(study, begun, undisturbed):
    """The whole way: ``dvc repro`` killed in the middle of a stage, then ``dvc repro`` again."""
    stage = LONG_STAGES["train"]
    change(study.folder, stage.params)
    command = ["dvc", "repro", "--single-item", "train@sim"]
    process = begun(*command)
    wait_for_a_checkpoint(study, process)
    stop(process, signal.SIGKILL)
    assert "Running stage 'train@sim'" in study.run(*command)
    assert digests(study.folder / stage.output) == undisturbed("train")[0]
    assert "didn't change" in study.run(*command)


def test_a_shard_of_fewer_demonstrations_is_not_taken_for_a_larger_one(tmp_path, root):
    """As the last one is when a killed stage begins again with more."""
    simulate_shard = runpy.run_path(str(root / "stages" / "simulate.py"))["simulate_shard"]
    what = (tmp_path, 42, "diverse", "push", "diverse", False, 0)
    fewer = simulate_shard(*what, 2, 32)
    assert simulate_shard(*what, 2, 32) == fewer
    more = simulate_shard(*what, 3, 32)
    assert len(more["rows"]) == more["file"]["clips"] == 3
