"""The scratch folder: checkpoints and decoded frames, which any machine can make again.

``ANYVIEW_SCRATCH`` names it (default ``~/.cache/anyview``). Entries are keyed by a hash of what they were
made from (params, code, data), so that a change in any of these starts afresh and nothing stale is read.
"""

import errno
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

from filelock import FileLock, Timeout

KINDS = ("checkpoints", "frames")
_AFTERWARDS = ("analysis", "report", "review", "cli", "parallel")  # folders whose code makes no result

_NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)  # what a file system without locks answers

# Locks of the folders of checkpoints that this process works in: they end with it, even if it is killed.
_locks: dict[Path, FileLock] = {}


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
    """Make ``folder`` and keep it for this process; False if another process has it.

    The lock is an empty file beside the folder. It stays there, unlocked, until ``clear_scratch``.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    lock = _locks.setdefault(folder, FileLock(_lock_file(folder), thread_local=False, fallback_to_soft=False))
    if not lock.is_locked:
        try:
            lock.acquire(blocking=False)
        except Timeout:
            return False
        except OSError as error:
            if error.errno not in _NO_LOCKS:
                raise  # without locks, the work is ours alone, as a rule
    folder.mkdir(exist_ok=True)
    return True


def _lock_file(folder: Path) -> Path:
    return folder.with_name(f"{folder.name}.lock")


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
    for entry in (scratch_root() / "frames").glob("*"):
        shutil.rmtree(entry, ignore_errors=True)
    for folder in {entry.with_suffix("") for entry in (scratch_root() / "checkpoints").glob("*")}:
        if _claim(folder):
            shutil.rmtree(folder, ignore_errors=True)
            _lock_file(folder).unlink(missing_ok=True)
            _locks.pop(folder).release()
    for kind in KINDS:
        with suppress(OSError):  # not empty, or not there
            (scratch_root() / kind).rmdir()
    return before - scratch_size()
