"""`anyview repro` by the real command line: the results of plain `dvc repro`, whatever the number of jobs."""

import json
import os
import pty
import re
import signal
import termios
import time
from contextlib import suppress

import psutil
import pytest

from tests.parallel.toys import DIAMOND, Toy


@pytest.fixture(scope="module")
def fresh(tmp_path_factory) -> Toy:
    return Toy(tmp_path_factory.mktemp("fresh") / "toy", DIAMOND)


@pytest.fixture(scope="module")
def plain(fresh, tmp_path_factory) -> Toy:
    """What plain `dvc repro` makes."""
    toy = fresh.copy(tmp_path_factory.mktemp("plain") / "toy")
    toy.run("dvc", "repro", "-q")
    return toy


@pytest.mark.parametrize("jobs", ["1", "4"])
def test_the_lock_is_that_of_dvc_repro(fresh, plain, tmp_path, jobs):
    """Byte for byte, also where another stage ends first; and then nothing is left to do."""
    toy = fresh.copy(tmp_path / "toy")
    assert "5 ran" in toy.run("anyview", "repro", "--jobs", jobs)
    assert toy.read("dvc.lock") == plain.read("dvc.lock")
    assert toy.read("end") == plain.read("end")
    assert "Data and pipelines are up to date." in toy.run("dvc", "repro")
    assert "Data and pipelines are up to date." in toy.run("anyview", "repro")


def test_stages_run_side_by_side_each_after_what_it_depends_on(fresh, tmp_path):
    """Two stages meet: each waits for a sign of the other, which plain `dvc repro` would wait for in vain."""
    text = DIAMOND.replace(
        "sleep 0.2; cat start > ${item}",
        "touch here-${item}; until [ -e here-left ] && [ -e here-right ]; do sleep 0.01; done;"
        " cat start > ${item}",
    )
    toy = fresh.copy(tmp_path / "toy")
    (toy.folder / "dvc.yaml").write_text(text)
    events = [json.loads(line) for line in toy.run("anyview", "repro", "-j", "2", "--json").splitlines()]
    order = [(each["event"], each["stage"]) for each in events if "stage" in each]
    for before, after in (("start", "middle@left"), ("middle@left", "end"), ("middle@right", "end")):
        assert order.index(("ended", before)) < order.index(("started", after))
    assert events[-1] == {
        "event": "end",
        "stages": {"ran": ["start", "middle@left", "middle@right", "end", "apart"]},
    }


def test_targets_force_and_the_run_cache(plain, tmp_path):
    """A target brings what it depends on; --force runs that too; what ran before comes from the run cache."""
    toy = plain.copy(tmp_path / "toy")
    said = toy.run("anyview", "repro", "middle@left", "--force", "--jobs", "2")
    assert "2 ran" in said
    assert "right" not in said
    assert toy.read("dvc.lock") == plain.read("dvc.lock")
    (toy.folder / "dvc.lock").unlink()
    # DVC's run cache takes no stage without dependencies.
    assert "3 cached, 2 ran" in toy.run("anyview", "repro")
    assert toy.read("dvc.lock") == plain.read("dvc.lock")
    assert toy.run("anyview", "repro", "nowhere", code=2).startswith("error: dvc: Stage 'nowhere' not found")


def test_dry_tells_what_would_run(plain, tmp_path):
    toy = plain.copy(tmp_path / "toy")
    (toy.folder / "dvc.yaml").write_text(DIAMOND.replace("echo 2", "echo 3"))
    (toy.folder / "left").unlink()
    before = toy.read("dvc.lock")
    rows = json.loads(toy.run("anyview", "repro", "--dry", "--json", "--jobs", "2"))
    assert {row["stage"]: row["forecast"] for row in rows} == {
        "start": "unchanged",
        "middle@right": "unchanged",
        "middle@left": "cached",
        "end": "may run",
        "apart": "runs",
    }
    assert toy.read("dvc.lock") == before
    assert toy.read("apart") == "2\n"


def test_a_failure_stops_what_depends_on_it(fresh, tmp_path):
    """The rest finishes, and the summary names the log; with --fail-fast nothing more starts."""
    toy = fresh.copy(tmp_path / "toy")
    (toy.folder / "dvc.yaml").write_text(
        DIAMOND.replace("cat start >", "echo oh dear && false && cat start >")
    )
    said = toy.run("anyview", "repro", "-j", "1", code=1)
    assert "2 ran, 2 failed" in said
    assert "skipped: end" in said
    assert "cat '.dvc/tmp/parallel/logs/middle@left.log'" in said
    assert "oh dear" in toy.read(".dvc/tmp/parallel/logs/middle@left.log")
    assert set(toy.lock()) == {"start", "apart"}
    toy.run("dvc", "repro", "--keep-going", code=255)
    assert set(toy.lock()) == {"start", "apart"}
    text = toy.read("dvc.yaml").replace("echo 2", "echo 3")
    (toy.folder / "dvc.yaml").write_text(text)
    toy.run("anyview", "repro", "-j", "1", "--fail-fast", "middle@left", "apart", code=1)
    assert toy.read("apart") == "2\n"


def test_an_unchanged_dependency_that_two_share_blocks_none(plain, tmp_path):
    """As two people would: one `anyview repro` runs a stage, another one wants the other (dvc #11054)."""
    toy = plain.copy(tmp_path / "toy")
    text = DIAMOND.replace("sleep 0.2", "touch here-${item}; until [ -e go-${item} ]; do sleep 0.01; done")
    (toy.folder / "dvc.yaml").write_text(text)
    (toy.folder / "go-right").touch()
    first = toy.start("anyview", "repro", "middle@left")
    toy.wait_for("here-left", first)
    assert "1 ran" in toy.run("anyview", "repro", "middle@right")
    (toy.folder / "go-left").touch()
    said, _ = first.communicate()
    assert "1 ran" in said


def test_a_stage_that_is_ended_alone_is_told(plain, tmp_path):
    """By SIGTERM, as by an administrator, while it waits for another DVC that runs it."""
    toy = plain.copy(tmp_path / "toy")
    text = DIAMOND.replace("sleep 0.2", "touch here-${item}; until [ -e go ]; do sleep 0.01; done")
    (toy.folder / "dvc.yaml").write_text(text)
    other = toy.start("dvc", "repro", "--single-item", "middle@left")
    toy.wait_for("here-left", other)
    process = toy.start("anyview", "repro", "--jobs", "1", "middle@left", "end")
    log = toy.folder / ".dvc/tmp/parallel/logs/middle@left.log"
    toy.wait_for(str(log), process)
    while "waiting" not in log.read_text():
        time.sleep(0.02)
    (child,) = psutil.Process(process.pid).children()
    child.terminate()
    child.wait()
    (toy.folder / "go").touch()
    said, _ = process.communicate(timeout=60)
    other.communicate()
    assert process.returncode == 1, said
    told = "middle@left interrupted: ended by SIGTERM; run the same command again to continue; its log: cat "
    assert f"{told}'.dvc/tmp/parallel/logs/middle@left.log'" in said
    assert "skipped: end" in said
    assert "1 interrupted" in said


def test_each_stage_has_its_part_of_the_cores(fresh, tmp_path):
    text = "stages:\n  a: {cmd: echo $ANYVIEW_WORKERS > a, outs: [a], meta: {cores: 3}}\n"
    toy = fresh.copy(tmp_path / "toy")
    (toy.folder / "dvc.yaml").write_text(text)
    toy.run("anyview", "repro", "--jobs", "2", ANYVIEW_WORKERS="16")
    assert toy.read("a") == "2\n"
    (toy.folder / "dvc.yaml").write_text(text.replace("3", "many"))
    said = toy.run("anyview", "repro", code=2)
    assert said == "error: stage a: meta.cores=many: must be a whole number of at least 1\n"
    (toy.folder / "dvc.yaml").write_text(text.replace("cores: 3", "gpus: 99"))
    assert "error: stage a: meta.gpus=99, and this machine has " in toy.run("anyview", "repro", code=2)


COUNTING = """
stages:
  first: {cmd: "echo 3/4; until [ -e go ]; do sleep 0.05; done; touch first", outs: [first]}
  second:
    foreach: [left, right]
    do: {cmd: "cp first ${item}", deps: [first], outs: ["${item}"]}
"""


def test_on_a_terminal_a_table_shows_what_runs_and_what_waits(fresh, tmp_path):
    toy = fresh.copy(tmp_path / "toy")
    (toy.folder / "dvc.yaml").write_text(COUNTING)
    screen, terminal = pty.openpty()
    termios.tcsetwinsize(terminal, (20, 70))
    process = toy.start("anyview", "repro", "--jobs", "2", stdout=terminal, TERM="xterm")
    os.close(terminal)
    said = ""
    while "wait for first" not in said or "75%" not in said:
        said += os.read(screen, 4096).decode()
    (toy.folder / "go").touch()
    assert re.search(r"first +█{12}░{4} +\S+ s +75% .*3/4", said), said
    assert "second@left, second@right wait for first" in said
    with suppress(OSError):  # as reading a terminal ends
        while part := os.read(screen, 4096).decode():
            said += part
    assert process.wait() == 0
    assert "first: ran in " in said
    assert said.rpartition("\n")[0].endswith("3 ran\r")


SLOW = """
stages:
  one: {cmd: touch here-one; sleep 1000 & wait; echo > one, outs: [one]}
  two: {cmd: touch here-two; sleep 1000; echo > two, outs: [two]}
"""


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_nothing_outlives_the_scheduler(fresh, tmp_path, end):
    """And nothing of DVC's is left locked."""
    toy = fresh.copy(tmp_path / "toy")
    (toy.folder / "dvc.yaml").write_text(SLOW)
    process = toy.start("anyview", "repro", "--jobs", "2")
    toy.wait_for("here-one", process)
    toy.wait_for("here-two", process)
    process.send_signal(end)
    said, _ = process.communicate(timeout=30)
    assert process.returncode == (130 if end != signal.SIGKILL else -signal.SIGKILL)
    assert "Traceback" not in said
    deadline = time.monotonic() + 10
    while toy.processes():
        assert time.monotonic() < deadline, toy.processes()
        time.sleep(0.1)
    (toy.folder / "dvc.yaml").write_text(SLOW.replace("sleep 1000", "true"))
    assert "2 ran" in toy.run("anyview", "repro")


def test_what_a_kill_leaves_of_dvcs_locks_is_no_obstacle(plain, tmp_path):
    toy = plain.copy(tmp_path / "toy")
    (toy.folder / ".dvc" / "tmp" / "rwlock").write_text('{"read": {"/a')
    assert "up to date" in toy.run("anyview", "repro")
