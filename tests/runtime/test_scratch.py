import errno
import fcntl
import os
import subprocess
import sys
from pathlib import Path

import pytest

from anyview.runtime.scratch import (
    clear_scratch,
    content_key,
    scratch_folder,
    scratch_root,
    scratch_size,
)


def test_the_key_follows_values_names_and_bytes(tmp_path):
    one, two = tmp_path / "one.py", tmp_path / "two.py"
    one.write_text("1")
    two.write_text("2")
    key = content_key({"seed": 1, "cell": "ours"}, [one, two])
    assert content_key({"cell": "ours", "seed": 1}, [two, one]) == key
    keys = {key, content_key({"seed": 2, "cell": "ours"}, [one, two]), content_key({"seed": 1}, [one, two])}
    keys.add(content_key({"seed": 1, "cell": "ours"}, [one]))
    two.write_text("3")
    keys.add(content_key({"seed": 1, "cell": "ours"}, [one, two]))
    assert len(keys) == 5


def test_size_and_clear(scratch):
    bystander = scratch / "not-ours"
    bystander.write_text("keep me")
    (scratch_folder("frames", "abc") / "frames.npy").write_bytes(b"x" * 100_000)
    (scratch_folder("checkpoints", "def") / "checkpoint-a").write_bytes(b"x" * 100_000)
    assert 200_000 <= scratch_size() < 250_000
    assert clear_scratch() >= 200_000
    assert scratch_size() == 0
    assert bystander.read_text() == "keep me"


def test_the_folder_is_absolute_and_may_start_at_home(monkeypatch):
    monkeypatch.setenv("ANYVIEW_SCRATCH", "here")
    assert scratch_root() == Path.cwd() / "here"
    monkeypatch.setenv("ANYVIEW_SCRATCH", "~/there")
    assert scratch_root() == Path.home() / "there"
    monkeypatch.setenv("ANYVIEW_SCRATCH", "")
    assert scratch_root() == Path.home() / ".cache" / "anyview"


def test_only_known_kinds(scratch):
    with pytest.raises(ValueError, match="scratch kinds"):
        scratch_folder("policies", "abc")


def test_checkpoints_are_keyed_by_the_code_too(scratch):
    """Frames follow from the clips alone; what is half done follows from the code that does it."""
    assert scratch_folder("frames", "abc").name == "abc"
    first = scratch_folder("checkpoints", "abc")
    assert first.name.startswith("abc-")
    assert scratch_folder("checkpoints", "abc") == first


def at_work(key: str) -> tuple[subprocess.Popen, Path]:
    """Another process that has checkpoints in the folder it names, until its input ends."""
    program = (
        "import sys; from anyview.runtime.scratch import scratch_folder; "
        f"folder = scratch_folder('checkpoints', '{key}'); (folder / 'half').write_text('half'); "
        "print(folder, flush=True); sys.stdin.read()"
    )
    command = [sys.executable, "-c", program]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    return process, Path(process.stdout.readline().strip())


def test_two_processes_at_the_same_work_keep_apart(scratch):
    """And after a kill the folder is there for the next one, with what was half done."""
    first, folder = at_work("abc")
    second, other = at_work("abc")
    assert other.parent == folder.parent
    assert other != folder
    for process in (first, second):
        process.kill()
        process.communicate()
    third, again = at_work("abc")
    assert again == folder
    assert (again / "half").read_text() == "half"
    third.communicate()


def test_clear_leaves_the_checkpoints_of_a_process_at_work(scratch):
    process, folder = at_work("abc")
    (scratch_folder("checkpoints", "def") / "checkpoint-a").touch()
    clear_scratch()
    assert (folder / "half").exists()
    assert {path.name for path in folder.parent.iterdir()} == {folder.name, f"{folder.name}.lock"}
    process.kill()
    process.communicate()
    clear_scratch()
    assert not folder.parent.exists()


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP])
def test_a_file_system_without_locks_is_used_without_them(scratch, monkeypatch, number):
    def refuse(descriptor, operation):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", refuse)
    folder = scratch_folder("checkpoints", "abc")
    assert folder.is_dir()
    assert scratch_folder("checkpoints", "abc") == folder
    clear_scratch()
    assert list(scratch.iterdir()) == []


def test_a_folder_that_was_removed_is_made_again(scratch):
    first = scratch_folder("checkpoints", "abc")
    first.rmdir()
    assert scratch_folder("checkpoints", "abc") == first
    assert first.is_dir()
