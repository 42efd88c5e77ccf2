"""Kills at random moments of a parallel run, then one more `anyview repro`: the undisturbed run's lock."""

import os
import random
import signal
import subprocess
import time
from contextlib import suppress
from pathlib import Path

import psutil
import pytest
from ruamel.yaml import YAML

from tests.conftest import Study
from tests.long_stages import digests
from tests.parallel.toys import Toy

CHAINS = """
stages:
  first:
    foreach: [a, b, c, d]
    do: {cmd: "sleep 0.3; mkdir ${item}1; echo ${item} > ${item}1/x", outs: ["${item}1"]}
  second:
    foreach: [a, b, c, d]
    do: {cmd: "sleep 0.3; cp -r ${item}1 ${item}2", deps: ["${item}1"], outs: ["${item}2"]}
  last: {cmd: cat a2/x b2/x c2/x d2/x > all, deps: [a2, b2, c2, d2], outs: [all]}
"""
KILLS = 20


def victims(process: subprocess.Popen[str]) -> list[psutil.Process]:
    """The scheduler, the process of each stage, its command, and whatever that has started."""
    try:
        scheduler = psutil.Process(process.pid)
        return [scheduler, *scheduler.children(recursive=True)]
    except psutil.NoSuchProcess:
        return []


def kill_one(process: subprocess.Popen[str], rng: random.Random, latest: float) -> None:
    """Kill one of the run's processes within ``latest`` seconds; wait for the end of the run."""
    time.sleep(rng.uniform(0, latest))
    if there := victims(process):
        with suppress(psutil.NoSuchProcess):
            rng.choice(there).send_signal(rng.choice([signal.SIGKILL, signal.SIGTERM]))
    process.communicate(timeout=900)  # of which a busy machine may need half: the other stages go on


def lock_of(folder: Path) -> dict[str, object]:
    return YAML(typ="safe").load((folder / "dvc.lock").read_text())["stages"]


@pytest.mark.slow
def test_twenty_kills_change_nothing(tmp_path):
    plain = Toy(tmp_path / "plain", CHAINS)
    toy = plain.copy(tmp_path / "toy")
    plain.run("dvc", "repro", "-q")
    rng = random.Random(0)
    for number in range(KILLS):
        if number % 5 == 0:  # else the rest of what the kill before has left
            toy = plain.copy(tmp_path / f"toy-{number}")
            (toy.folder / "dvc.lock").unlink()
            (toy.folder / "dvc.yaml").write_text(CHAINS)
            subprocess.run(["rm", "-rf", ".dvc/cache"], cwd=toy.folder, check=True)
        kill_one(toy.start("anyview", "repro", "--jobs", "4", "--force"), rng, 5.0)
        deadline = time.monotonic() + 30
        while toy.processes():
            assert time.monotonic() < deadline, toy.processes()
            time.sleep(0.1)
        if number % 5 == 4:
            toy.run("anyview", "repro", "--jobs", "4")
            assert toy.lock() == plain.lock()
            assert toy.read("all") == plain.read("all")
            assert "up to date" in toy.run("dvc", "repro")


@pytest.mark.slow
def test_the_smoke_profile_is_that_of_dvc_repro_after_three_kills(trunk: Study, smoke: Study, tmp_path):
    study = trunk.copy(tmp_path)
    rng = random.Random(1)
    for _ in range(3):
        kill_one(study.start("anyview", "repro", "--jobs", str(os.cpu_count())), rng, 20.0)
    study.run("anyview", "repro")
    assert lock_of(study.folder) == lock_of(smoke.folder)
    assert digests(study.folder / "metrics") == digests(smoke.folder / "metrics")
    assert "up to date" in study.run("dvc", "repro")
