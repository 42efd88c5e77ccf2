"""Tasks that write files, done once: a killed stage finds what it had finished."""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from anyview.runtime.outputs import write_atomically


def once(folder: Path, name: str, make: Callable[[], tuple[Any, list[str]]]) -> Any:
    """The result of ``make()``, or the one that an earlier try left in ``folder`` under ``name``.

    ``make`` writes files into ``folder`` and returns its JSON-serialisable result and the files' names. An
    earlier result counts only while all its files have the SHA-256 that they had then. ``folder`` has to be
    keyed by everything that the result depends on (see ``runtime.scratch``).
    """
    record_path = folder / f"{name}.json"
    found, record = _read(folder, record_path)
    if found:
        return record
    result, files = make()
    record = {"result": result, "files": {file: sha256(folder / file) for file in files}}
    write_atomically(record_path, json.dumps(record))
    return json.loads(json.dumps(result))


def sha256(path: Path) -> str:
    """Hex SHA-256 of a file."""
    with path.open("rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()


def _read(folder: Path, record_path: Path) -> tuple[bool, Any]:
    try:
        record = json.loads(record_path.read_text(encoding="utf-8"))
        whole = all(sha256(folder / file) == digest for file, digest in record["files"].items())
        return whole, record["result"]
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return False, None
