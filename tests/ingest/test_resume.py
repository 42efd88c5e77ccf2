"""What an ingest that was killed had finished is not done again."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pandas as pd
import pytest

from tests.ingest.raw_clips import pictures, write_raw

CLIPS = 24


@pytest.fixture
def place(tmp_path, root) -> Path:
    """A folder to run stages in, with raw clips of one's own."""
    raw = tmp_path / "data" / "raw" / "recorded"
    files = [f"{index:02d}.avi" for index in range(CLIPS)]
    for index, file in enumerate(files):
        write_raw(raw / file, pictures(seed=index))
    table = pd.DataFrame({"file": files, "pair": "", "camera": "", "kind": "standard"})
    table.to_csv(raw / "manifest.csv", index=False)
    params = (root / "params.yaml").read_text()
    assert "source: surrogate" in params
    (tmp_path / "params.yaml").write_text(params.replace("source: surrogate", "source: recorded"))
    return tmp_path


def start(place: Path, root: Path) -> subprocess.Popen:
    command = [sys.executable, str(root / "stages" / "ingest.py")]
    environment = os.environ | {"ANYVIEW_WORKERS": "2"}
    return subprocess.Popen(command, cwd=place, env=environment, stderr=subprocess.PIPE, text=True)


def records(scratch: Path) -> dict[str, int]:
    """Finished units of work, with the time at which each was."""
    found = {}
    for path in scratch.glob("checkpoints/*/[!.]*.json"):
        with suppress(FileNotFoundError):  # the stage removes them when it is done
            found[path.name] = path.stat().st_mtime_ns
    return found


@pytest.mark.slow
def test_a_finished_clip_is_not_ingested_again(place, scratch, root):
    process = start(place, root)
    while len(records(scratch)) < CLIPS // 3:
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=60) == 130
    done = records(scratch)
    assert CLIPS // 3 <= len(done) < CLIPS

    process = start(place, root)
    seen: dict[str, int] = {}
    while process.poll() is None:
        seen |= records(scratch)
        time.sleep(0.005)
    assert process.returncode == 0, process.communicate()
    assert done.items() <= seen.items()
