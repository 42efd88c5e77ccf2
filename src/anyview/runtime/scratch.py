"""The scratch folder: checkpoints and decoded frames, which any machine can make again.

``ANYVIEW_SCRATCH`` names it (default ``~/.cache/anyview``). Entries are keyed by a hash of what they were
made from (params, code, data), so that a change in any of these starts afresh and nothing stale is read.
"""

import hashlib
import json
import os
import shutil
import sys
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

KINDS = ("checkpoints", "frames")


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


def scratch_folder(kind: str, key: str) -> Path:
    """Folder ``<scratch>/<kind>/<key>``, created. ``kind`` is one of ``KINDS``.

    The key of checkpoints is extended by one of our code, so that an edit of any module starts afresh.
    """
    if kind not in KINDS:
        raise ValueError(f"{kind}: scratch kinds are {', '.join(KINDS)}")
    folder = scratch_root() / kind / (f"{key}-{_code_key()}" if kind == "checkpoints" else key)
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@cache
def _code_key() -> str:
    """A key of every module that can change what is half done: the report comes after all of that."""
    package = Path(__file__).parents[1]
    modules = [path for path in package.rglob("*.py") if "report" not in path.relative_to(package).parts]
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
    """Empty the scratch folder; returns the bytes freed. Nothing but what we put there is touched."""
    before = scratch_size()
    for kind in KINDS:
        shutil.rmtree(scratch_root() / kind, ignore_errors=True)
    return before - scratch_size()
