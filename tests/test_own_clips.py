"""Clips of one's own, of mixed formats and lengths, from a folder of files to a queued experiment."""

import json
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest

from tests.conftest import Study, copy_of_the_repository
from tests.ingest.formats import encode
from tests.ingest.test_motion import film
from tests.test_disk import ordinary_user

# Seconds before, of and after the demonstration, frames a second, file, codec: two views of each.
VIEWS = (
    (1.0, 3.0, 1.0, 30.0, "push1-left.mp4", "libx264"),
    (2.0, 3.0, 1.0, 25.0, "push1-right.mov", "mpeg4"),
    (0.5, 12.0, 1.0, 15.0, "push2-left.mkv", "mpeg4"),
    (3.0, 12.0, 1.0, 20.0, "push2-right.ts", "libx264"),
    (1.0, 6.0, 1.0, 25.0, "push3-left.webm", "libvpx"),
    (0.5, 6.0, 2.0, 12.0, "push3-right.mp4", "libsvtav1"),
)


def put_clips(folder: Path) -> None:
    folder.mkdir(parents=True)
    for index, (before, task, after, fps, file, codec) in enumerate(VIEWS):
        options = {"b": "2M"} if codec in ("mpeg4", "libvpx") else {}
        encode(folder / file, film(before, task, after, fps, seed=index), codec, fps, options=options)


@pytest.fixture
def study(tmp_path) -> Study:
    """The `smoke` profile with clips under DVC, listed by the proposed manifest."""
    study = Study(copy_of_the_repository(tmp_path / "study"), tmp_path / "scratch")
    raw = study.folder / "data" / "raw" / "recorded"
    put_clips(raw)
    study.run("anyview", "profile", "smoke")
    study.run("anyview", "clips", "--propose")
    (raw / "manifest.proposed.csv").rename(raw / "manifest.csv")
    study.run("dvc", "add", "data/raw/recorded")
    study.run("git", "add", "-A")
    study.run("git", "-c", "user.name=test", "-c", "user.email=test@example.org", "commit", "-qm", "clips")
    return study


@pytest.mark.slow
def test_an_experiment_trains_a_translator_on_them(study):
    study.run("dvc", "exp", "run", "-n", "mine", "-S", "real.source=recorded", "translate@real-adam")
    found = json.loads(study.run("anyview", "clips", "--json"))
    assert (found["source"], found["refused"]) == ("recorded", [])
    assert found["sets"]["real"]["train"] >= 2
    assert found["sets"]["real"]["validation"] >= 2
    assert sum(found["sets"]["real"].values()) == len(VIEWS)
    clips = study.folder / "data" / "clips" / "real"
    listed = pd.read_csv(clips / "manifest.csv")
    assert sorted(listed["pair"]) == ["push1", "push1", "push2", "push2", "push3", "push3"]
    assert list((study.folder / "data" / "translations" / "real-adam").glob("*.csv"))


@pytest.mark.slow
def test_clips_under_dvc_are_found_by_a_queued_experiment(study):
    study.run("dvc", "exp", "run", "--queue", "-n", "mine", "-S", "real.source=recorded", "ingest")
    study.run("bash", "-c", "dvc queue start > /dev/null 2>&1")
    deadline = time.monotonic() + 300
    while "Success" not in (status := study.run("dvc", "queue", "status")):
        assert "Failed" not in status, study.run("dvc", "queue", "logs", "mine")
        assert time.monotonic() < deadline, status
        time.sleep(2)
    assert "6 clips accepted, 0 refused" in study.run("dvc", "queue", "logs", "mine")


def test_a_folder_without_the_right_to_write_is_told_in_one_line(tmp_path, root):
    (tmp_path / "params.yaml").write_text((root / "params.yaml").read_text())
    raw = tmp_path / "data" / "raw" / "recorded"
    raw.mkdir(parents=True)
    encode(raw / "push.mp4", film(1.0, 2.0, 1.0, 10.0), "mpeg4", 10.0)
    raw.chmod(0o555)
    done = subprocess.run(
        [sys.executable, "-m", "anyview", "clips", "--propose"],
        cwd=tmp_path,
        preexec_fn=ordinary_user,
        capture_output=True,
        text=True,
    )
    raw.chmod(0o755)
    assert done.returncode == 2
    assert done.stderr.startswith("error: ")
    assert done.stderr.endswith("Permission denied; check the permissions\n")
    assert done.stderr.count("\n") == 1
