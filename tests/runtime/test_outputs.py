import os
import resource
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from anyview.runtime.outputs import whole_folder, write_atomically


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_folder_appears_whole(tmp_path):
    target = tmp_path / "below" / "cell"
    with whole_folder(target) as folder:
        (folder / "weights").write_text("new")
        assert not target.exists()
    assert names(tmp_path / "below") == ["cell"]
    assert (target / "weights").read_text() == "new"


def test_a_new_folder_replaces_all_of_the_old_one(tmp_path):
    for name in ("old", "new"):
        with whole_folder(tmp_path / "cell") as folder:
            (folder / name).touch()
    assert names(tmp_path / "cell") == ["new"]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_error_leaves_the_old_folder_alone(tmp_path, error):
    with whole_folder(tmp_path / "cell") as folder:
        (folder / "old").touch()

    def fail() -> None:
        with whole_folder(tmp_path / "cell") as folder:
            (folder / "half").touch()
            raise error

    with pytest.raises(error):
        fail()
    assert names(tmp_path) == ["cell"]
    assert names(tmp_path / "cell") == ["old"]


def test_an_error_between_old_and_new_leaves_the_old_folder(tmp_path, monkeypatch):
    with whole_folder(tmp_path / "cell") as folder:
        (folder / "old").touch()
    rename = Path.rename

    def interrupted(path: Path, target: Path) -> Path:
        if path.name == ".cell.partial":
            raise KeyboardInterrupt
        return rename(path, target)

    def replace() -> None:
        with whole_folder(tmp_path / "cell"):
            monkeypatch.setattr(Path, "rename", interrupted)

    with pytest.raises(KeyboardInterrupt):
        replace()
    assert names(tmp_path) == ["cell"]
    assert names(tmp_path / "cell") == ["old"]


def test_leftovers_of_a_killed_process_are_not_mixed_in(tmp_path):
    script = (
        "import os, sys, pathlib; from anyview.runtime.outputs import whole_folder\n"
        "with whole_folder(pathlib.Path(sys.argv[1])) as folder:\n"
        "    (folder / 'half').touch(); os.kill(os.getpid(), 9)"
    )
    done = subprocess.run([sys.executable, "-c", script, str(tmp_path / "cell")])
    assert done.returncode == -signal.SIGKILL
    assert not (tmp_path / "cell").exists()
    with whole_folder(tmp_path / "cell") as folder:
        (folder / "whole").touch()
    assert names(tmp_path) == ["cell"]
    assert names(tmp_path / "cell") == ["whole"]


def test_a_file_is_replaced_or_kept(tmp_path):
    path = tmp_path / "below" / "table.csv"
    write_atomically(path, "a,b\n")
    write_atomically(path, b"c\n")
    assert path.read_bytes() == b"c\n"
    assert names(path.parent) == ["table.csv"]


def test_running_out_of_room_keeps_the_old_file(tmp_path):
    """A file size limit stands for a full disk: the write fails half-way in the same manner."""
    path = tmp_path / "table.csv"
    write_atomically(path, "old")

    def limit() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))

    script = (
        "import sys, pathlib; from anyview.runtime.errors import run_stage; "
        "from anyview.runtime.outputs import write_atomically\n"
        "run_stage(lambda arguments: write_atomically(pathlib.Path(arguments[0]), 'x' * 100_000))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, str(path)], preexec_fn=limit, capture_output=True, text=True
    )
    assert done.returncode == 2
    assert done.stderr == f"error: {path}: File too large\n"
    assert path.read_text() == "old"
    assert names(tmp_path) == ["table.csv"]


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "data").write_text("a file where a folder should be")
    with pytest.raises(OSError, match=os.strerror(20)), whole_folder(tmp_path / "data" / "cell"):
        pass
