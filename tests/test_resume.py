"""Long stages, killed at random moments, continue and end with the bytes of an uninterrupted run."""

import hashlib
import os
import random
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from tests.conftest import Study

SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
KILLS = 4

# Stage with its cell, output, and params that make the work last some seconds.
CASES = {
    "simulate": (
        ["stages/simulate.py", "diverse"],
        "data/sim/diverse",
        {"simulate.diverse.demos": 240, "simulate.shard": 8},
    ),
    "ingest": (["stages/ingest.py"], "data/real/clips", {}),
    "train": (
        ["stages/train.py", "sim"],
        "data/models/sim",
        {"translation.cells.sim.iterations": 120, "translation.training.validation_every": 10},
    ),
    "imitate": (
        ["stages/imitate.py", "ours"],
        "data/policies/ours",
        {"imitation.iterations": 15, "imitation.runs": 9},
    ),
}


def change(study: Study, **values: object) -> None:
    """Set dotted keys in the study's params.yaml."""
    path = study.folder / "params.yaml"
    yaml = YAML()
    tree = yaml.load(path.read_text())
    for key, value in values.items():
        *parents, last = key.split(".")
        branch = tree
        for parent in parents:
            branch = branch[parent]
        branch[last] = value
    with path.open("w") as file:
        yaml.dump(tree, file)


def digests(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.fixture
def study(smoke, tmp_path) -> Study:
    """A copy of the smoke study, with an empty scratch folder."""
    folder = tmp_path / "study"
    shutil.copytree(smoke.folder, folder, ignore=shutil.ignore_patterns(".venv", "tmp"))
    return Study(folder, tmp_path / "scratch")


def kill_at_random(study: Study, command: list[str], seconds: float, rng: random.Random) -> int:
    """Start ``command`` and kill it; returns its exit code. ``seconds`` is what it takes to its end."""
    number = rng.choice(SIGNALS)
    process = study.start("python", *command, ANYVIEW_CHECKPOINT_SECONDS="0")
    try:
        process.communicate(timeout=1 + rng.random() * seconds)
    except subprocess.TimeoutExpired:
        if number == signal.SIGINT:
            os.killpg(process.pid, number)  # as a terminal does
        else:
            process.send_signal(number)
        process.communicate(timeout=180)
    return process.returncode


def checkpointed(scratch: Path) -> bool:
    return any(path.is_file() and "partial" not in path.name for path in scratch.rglob("checkpoints/*/*"))


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_a_killed_stage_continues_to_the_same_bytes(study, case):
    command, output, params = CASES[case]
    change(study, **params)
    began = time.monotonic()
    study.run("python", *command)
    seconds = time.monotonic() - began
    expected = digests(study.folder / output)
    assert expected
    shutil.rmtree(study.folder / output)
    shutil.rmtree(study.scratch / "checkpoints", ignore_errors=True)

    rng = random.Random(case)
    resumed = 0
    for _ in range(KILLS):
        code = kill_at_random(study, command, seconds, rng)
        if code == 0 or (study.folder / output).exists():  # done before the signal: start over
            assert digests(study.folder / output) == expected
            shutil.rmtree(study.folder / output)
        else:
            resumed += checkpointed(study.scratch)
    assert resumed > 0, "no kill fell into the work: nothing was shown"
    study.run("python", *command)
    assert digests(study.folder / output) == expected
    leftovers = [path for path in (study.folder / "data").rglob(".*.partial")]
    assert leftovers == []


@pytest.mark.slow
def test_changed_params_start_afresh(study):
    """A checkpoint of other params is not taken up, and one of the same params still is."""
    command, output, params = CASES["train"]
    change(study, **params)
    change(study, **{"base.seed": 7})
    study.run("python", *command)
    expected = digests(study.folder / output)
    shutil.rmtree(study.scratch)
    change(study, **{"base.seed": 8})
    process = study.start("python", *command, ANYVIEW_CHECKPOINT_SECONDS="0")
    while not checkpointed(study.scratch):
        assert process.poll() is None
        time.sleep(0.02)
    process.kill()
    process.wait()
    change(study, **{"base.seed": 7})
    study.run("python", *command)
    assert digests(study.folder / output) == expected


@pytest.mark.slow
def test_a_killed_dvc_repro_continues(study):
    """The whole way: ``dvc repro`` killed in the middle of a stage, then ``dvc repro`` again."""
    _, output, params = CASES["train"]
    change(study, **params)
    command = ["dvc", "repro", "--single-item", "train@sim"]
    lock = (study.folder / "dvc.lock").read_text()
    study.run(*command)
    expected = digests(study.folder / output)
    (study.folder / "dvc.lock").write_text(lock)
    shutil.rmtree(study.scratch)
    shutil.rmtree(study.folder / ".dvc" / "cache" / "runs", ignore_errors=True)
    shutil.rmtree(study.folder / output)
    process = study.start(*command, ANYVIEW_CHECKPOINT_SECONDS="0")
    while not checkpointed(study.scratch):
        assert process.poll() is None
        time.sleep(0.02)
    process.kill()
    process.communicate()
    said = study.run(*command)
    assert "Running stage 'train@sim'" in said
    assert digests(study.folder / output) == expected


@pytest.mark.slow
@pytest.mark.parametrize("case", ["simulate", "ingest", "imitate"])
def test_one_worker_or_two_make_the_same_bytes(study, case):
    command, output, params = CASES[case]
    change(study, **params)
    found = []
    for workers in ("1", "2"):
        study.run("python", *command, ANYVIEW_WORKERS=workers)
        found.append(digests(study.folder / output))
        shutil.rmtree(study.folder / output)
        shutil.rmtree(study.scratch)
    assert found[0] == found[1]
