"""Checkpoints: atomic, checksummed, two deep, readable without executing code."""

import hashlib
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from anyview.runtime.outputs import write_atomically

_MAGIC = b"anyview-checkpoint-1\n"
_SLOTS = ("a", "b")


class Checkpoints:
    """The two newest checkpoints of one piece of work, in a scratch folder of its own.

    A checkpoint is a dictionary of numpy arrays and a JSON-serialisable ``state``. The file is the magic line,
    the SHA-256 of the rest, then a safetensors body that carries the state as metadata. A file that is cut
    short or altered fails its checksum and the one before it is used.
    """

    def __init__(self, folder: Path, every_seconds: float = 60.0):
        self.folder = folder
        self._every = every_seconds
        self._saved = time.monotonic()

    def due(self) -> bool:
        """Whether the last checkpoint is ``every_seconds`` old."""
        return time.monotonic() - self._saved >= self._every

    def save(self, step: int, arrays: dict[str, np.ndarray], state: dict[str, Any]) -> None:
        """Keep ``arrays`` and ``state`` as they are after ``step`` units of work."""
        contiguous = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
        body = save(contiguous, metadata={"step": str(step), "state": json.dumps(state)})
        content = _MAGIC + hashlib.sha256(body).hexdigest().encode() + b"\n" + body
        newest = self._newest_slot()
        slot = _SLOTS[1 - _SLOTS.index(newest)] if newest else _SLOTS[0]
        write_atomically(self._path(slot), content)
        self._saved = time.monotonic()

    def load(self) -> tuple[int, dict[str, np.ndarray], dict[str, Any]] | None:
        """The newest checkpoint that is whole: (step, arrays, state), or None."""
        found = [entry for slot in _SLOTS if (entry := self._read(slot)) is not None]
        return max(found, key=lambda entry: entry[0]) if found else None

    def clear(self) -> None:
        """Remove the checkpoints: the work is finished and its output stands."""
        for slot in _SLOTS:
            self._path(slot).unlink(missing_ok=True)

    def _path(self, slot: str) -> Path:
        return self.folder / f"checkpoint-{slot}"

    def _newest_slot(self) -> str | None:
        entries = [(entry[0], slot) for slot in _SLOTS if (entry := self._read(slot)) is not None]
        return max(entries)[1] if entries else None

    def _read(self, slot: str) -> tuple[int, dict[str, np.ndarray], dict[str, Any]] | None:
        try:
            content = self._path(slot).read_bytes()
        except OSError:
            return None
        head = len(_MAGIC) + 65
        body = content[head:]
        if content[:head] != _MAGIC + hashlib.sha256(body).hexdigest().encode() + b"\n":
            return None
        try:
            arrays = load(body)
            metadata = json.loads(body[8 : 8 + int.from_bytes(body[:8], "little")])["__metadata__"]
        except (SafetensorError, ValueError, KeyError):
            return None
        return int(metadata["step"]), arrays, json.loads(metadata["state"])
