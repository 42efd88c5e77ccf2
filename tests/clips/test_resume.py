"""A stage that is killed continues where it was, and its output has the same bytes."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pandas as pd
import pytest

from tests.clips.raw_clips import pictures, write_raw

CLIPS = 24
OUTPUTS = {"ingest.py": "data/real/clips", "film.py": "data/real/surrogate"}


@pytest.fixture(scope="module")
def place(tmp_path_factory, root) -> Path:
    """A folder to run stages in, with raw clips of one's own and a small plan to film."""
    folder = tmp_path_factory.mktemp("place")
    raw = folder / "data" / "real" / "raw"
    files = [f"{index:02d}.avi" for index in range(CLIPS)]
    for index, file in enumerate(files):
        write_raw(raw / file, pictures(seed=index))
    table = pd.DataFrame({"file": files, "pair": "", "camera": "", "kind": "standard"})
    table.to_csv(raw / "manifest.csv", index=False)
    params = (root / "params.yaml").read_text()
    changes = {"source: surrogate": "source: recorded", "  pairs: 71": "  pairs: 4"}
    changes |= {"extreme_pairs: 5": "extreme_pairs: 1", "width: 640": "width: 160"}
    for old, new in changes.items():
        assert old in params
        params = params.replace(old, new, 1)
    (folder / "params.yaml").write_text(params)
    return folder


def start(stage: str, place: Path, scratch: Path, root: Path) -> subprocess.Popen:
    environment = os.environ | {"ANYVIEW_SCRATCH": str(scratch), "ANYVIEW_WORKERS": "2"}
    return subprocess.Popen(
        [sys.executable, str(root / "stages" / stage)],
        cwd=place,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def records(scratch: Path) -> dict[str, int]:
    """Finished units of work, with the time at which each was."""
    found = {}
    for path in scratch.glob("checkpoints/*/[!.]*.json"):
        with suppress(FileNotFoundError):  # the stage removes them when it is done
            found[path.name] = path.stat().st_mtime_ns
    return found


@pytest.fixture(scope="module")
def undisturbed(place, root, tmp_path_factory) -> dict[str, dict[str, bytes]]:
    """What each stage makes when nobody stops it."""
    made = {}
    for stage, output in OUTPUTS.items():
        process = start(stage, place, tmp_path_factory.mktemp("undisturbed"), root)
        assert process.wait(timeout=600) == 0
        made[stage] = contents(place / output)
    return made


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stage", "units", "stop"),
    [
        ("ingest.py", CLIPS, signal.SIGINT),
        ("film.py", 6, signal.SIGKILL),
    ],
)
def test_a_killed_stage_continues_to_the_same_bytes(place, undisturbed, tmp_path, root, stage, units, stop):
    folder = place / OUTPUTS[stage]
    process = start(stage, place, tmp_path, root)
    while len(records(tmp_path)) < units // 3:
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)
    process.send_signal(stop)
    _, err = process.communicate(timeout=60)
    assert process.returncode == {signal.SIGKILL: -9}.get(stop, 130)
    assert "Traceback" not in err
    assert contents(folder) == undisturbed[stage]  # the earlier output stands
    done = records(tmp_path)
    assert len(done) < units

    process = start(stage, place, tmp_path, root)
    seen: dict[str, int] = {}
    while process.poll() is None:
        seen |= records(tmp_path)
        time.sleep(0.005)
    assert process.returncode == 0, process.communicate()
    assert contents(folder) == undisturbed[stage]
    assert done.items() <= seen.items()  # nothing that was finished was done again
    assert not list(tmp_path.glob("checkpoints/*/*"))
