"""The scratch folder: checkpoints and decoded frames, which any machine can make again.

``ANYVIEW_SCRATCH`` names it (default ``~/.cache/anyview``). Entries are keyed by a hash of what they were
made from (params, code, data), so that a change in any of these starts afresh and nothing stale is read.
"""

import fcntl
import hashlib
import json
import os
import shutil
import sys
from collections.abc import Iterable
from contextlib import suppress
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any

KINDS = ("checkpoints", "frames")
_AFTERWARDS = ("analysis", "report", "review", "cli")  # folders whose code only looks at what is finished

# Folders of checkpoints that this process works in, each open and so locked until the process ends.
_claimed: dict[Path, int] = {}


def scratch_root() -> Path:
    """The scratch folder (not created)."""
    return Path(os.environ.get("ANYVIEW_SCRATCH") or "~/.cache/anyview").expanduser().absolute()


def content_key(values: Any, files: Iterable[Path] = ()) -> str:
    """Hex key of JSON-serialisable ``values`` and of the bytes of ``files`` (order does not matter)."""
    digest = hashlib.sha256(json.dumps(values, sort_keys=True).encode())
    for path in sorted(files):
        digest.update(b"\0" + path.name.encode() + b"\0")
        with path.open("rb") as handle:
            digest.update(hashlib.file_digest(handle, "sha256").digest())
    return digest.hexdigest()[:24]


def checkpoint_folder(values: Any, files: Iterable[Path] = ()) -> Path:
    """Folder for checkpoints of work that depends on ``values``, on ``files`` and on our code.

    ``values`` are JSON-serialisable. A change in any of these gives another folder, so that nothing stale is
    continued.
    """
    return scratch_folder("checkpoints", content_key(values, files))


def scratch_folder(kind: str, key: str) -> Path:
    """Folder ``<scratch>/<kind>/<key>``, created. ``kind`` is one of ``KINDS``.

    The key of checkpoints is extended by one of our code, so that an edit of any module starts afresh, and by
    a number where another process is at the same work, in another clone for example.
    """
    if kind not in KINDS:
        raise ValueError(f"{kind}: scratch kinds are {', '.join(KINDS)}")
    if kind == "checkpoints":
        name = f"{key}-{_code_key()}"
        names = (name if number == 1 else f"{name}-{number}" for number in count(1))
        return next(folder for each in names if _claim(folder := scratch_root() / kind / each))
    folder = scratch_root() / kind / key
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _claim(folder: Path) -> bool:
    """Make ``folder`` and keep it for this process; False where another process has it."""
    while not _is_claimed(folder):
        folder.mkdir(parents=True, exist_ok=True)
        try:
            descriptor = os.open(folder, os.O_RDONLY)
        except FileNotFoundError:  # the one before us has just finished and removed it
            continue
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            return False
        except OSError:  # a file system without locks: the work is ours alone, as a rule
            pass
        _claimed[folder] = descriptor
    return True


def _is_claimed(folder: Path) -> bool:
    """Whether this process has ``folder``; lets go of it where it was removed since."""
    if folder not in _claimed:
        return False
    if folder.exists() and os.path.samestat(os.stat(folder), os.fstat(_claimed[folder])):
        return True
    os.close(_claimed.pop(folder))
    return False


@cache
def _code_key() -> str:
    """A key of every module that can change what is half done: the report comes after all of that."""
    package = Path(__file__).parents[1]
    modules = [
        path for path in package.rglob("*.py") if path.relative_to(package).parts[0] not in _AFTERWARDS
    ]
    script = getattr(sys.modules["__main__"], "__file__", None)
    paths = [*modules, Path(script)] if script else modules
    return content_key([str(path.relative_to(package)) for path in sorted(modules)], paths)[:8]


def scratch_size() -> int:
    """Bytes that the scratch folder holds."""
    size = 0
    for kind in KINDS:
        for folder, _, names in os.walk(scratch_root() / kind):
            for name in names:
                try:
                    size += os.lstat(os.path.join(folder, name)).st_blocks * 512
                except FileNotFoundError:  # a stage at work may remove a file under our eyes
                    continue
    return size


def clear_scratch() -> int:
    """Empty the scratch folder but for checkpoints of stages at work; returns the bytes freed.

    Nothing but what we put there is touched.
    """
    before = scratch_size()
    for kind in KINDS:
        for entry in (scratch_root() / kind).glob("*"):
            if kind != "checkpoints" or not entry.is_dir() or _claim(entry):
                shutil.rmtree(entry, ignore_errors=True)
        with suppress(OSError):  # not empty, or not there
            (scratch_root() / kind).rmdir()
    return before - scratch_size()
