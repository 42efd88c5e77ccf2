"""The scratch folder: checkpoints and decoded frames, which any machine can make again.

``ANYVIEW_SCRATCH`` names it (default ``~/.cache/anyview``). Entries are keyed by a hash of what they were
made from (params, code, data), so that a change in any of these starts afresh and nothing stale is read.
"""

import hashlib
import json
import os
import shutil
from collections.abc import Iterable
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
    """Folder ``<scratch>/<kind>/<key>``, created. ``kind`` is one of ``KINDS``."""
    if kind not in KINDS:
        raise ValueError(f"{kind}: scratch kinds are {', '.join(KINDS)}")
    folder = scratch_root() / kind / key
    folder.mkdir(parents=True, exist_ok=True)
    return folder


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
