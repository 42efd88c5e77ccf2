"""A disk that is full, a folder that is read-only: a clear message, and what was there stays as it was."""

import ctypes
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from tests.ingest.raw_clips import pictures, write_raw
from tests.long_stages import digests

PR_CAPBSET_DROP, CAP_DAC_OVERRIDE = 24, 1


def full_disk() -> None:
    """Files of 6 kB at most: a write fails half-way, as on a full disk."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (6_000, 6_000))


def ordinary_user() -> None:
    """Permissions count for root, too."""
    ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, CAP_DAC_OVERRIDE)


def run(place: Path, root: Path, stage: str, *arguments: str, under: Callable[[], None] | None = None) -> str:
    """Run a stage in ``place``; returns what it said on standard error, which is one line where it fails."""
    done = subprocess.run(
        [sys.executable, str(root / "stages" / stage), *arguments],
        cwd=place,
        env=os.environ | {"ANYVIEW_WORKERS": "1"},
        preexec_fn=under,
        capture_output=True,
        text=True,
    )
    assert done.returncode == (2 if under else 0), done.stderr
    return done.stderr


@pytest.fixture
def place(tmp_path, root) -> Path:
    """A folder in which clips of one's own were ingested and split."""
    raw = tmp_path / "data" / "raw" / "recorded"
    files = [f"{index:02d}.avi" for index in range(8)]
    for index, file in enumerate(files):
        write_raw(raw / file, pictures(seed=index))
    table = pd.DataFrame({"file": files, "pair": "", "camera": "", "kind": "standard"})
    table.to_csv(raw / "manifest.csv", index=False)
    params = (root / "params.yaml").read_text()
    (tmp_path / "params.yaml").write_text(params.replace("source: surrogate", "source: recorded"))
    run(tmp_path, root, "ingest.py")
    run(tmp_path, root, "split.py", "real")
    return tmp_path


@pytest.mark.parametrize("stage", [["ingest.py"], ["simulate.py", "narrow"]])
def test_a_full_disk_is_told_and_harms_nothing(place, root, stage):
    before = digests(place / "data")
    assert "disk full?" in run(place, root, *stage, under=full_disk)
    assert digests(place / "data") == before


@pytest.mark.parametrize(
    ("stage", "folder"), [(["ingest.py"], "data/clips"), (["split.py", "real"], "data/splits")]
)
def test_a_read_only_folder_is_told_and_harms_nothing(place, root, stage, folder):
    before = digests(place / "data")
    (place / folder).chmod(0o555)
    said = run(place, root, *stage, under=ordinary_user)
    (place / folder).chmod(0o755)
    assert said.startswith(f"error: {folder}/")
    assert said.endswith("Permission denied; check the permissions\n")
    assert digests(place / "data") == before


def test_a_read_only_scratch_folder_is_told(place, root, scratch):
    for kind in scratch.iterdir():
        kind.chmod(0o555)
    scratch.chmod(0o555)
    assert run(place, root, "ingest.py", under=ordinary_user).startswith(f"error: {scratch}/checkpoints")
    scratch.chmod(0o755)
