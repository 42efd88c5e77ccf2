"""Checkpoints: atomic, checksummed, two deep, readable without executing code."""

import hashlib
import json
import os
import time
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from anyview.runtime.errors import AnyviewError
from anyview.runtime.outputs import write_atomically

_MAGIC = b"anyview-checkpoint-1\n"
_SLOTS = ("checkpoint-a", "checkpoint-b")

Checkpoint = tuple[int, dict[str, np.ndarray], dict[str, Any]]


class Checkpoints:
    """The two newest checkpoints of one piece of work, in a scratch folder of its own.

    A checkpoint is a dictionary of numpy arrays and a JSON-serialisable ``state``. The file is the magic
    line, the SHA-256 of the rest, then a safetensors body that carries the state as metadata. A file that is
    cut short or altered fails its checksum and the one before it is used.

    ``ANYVIEW_CHECKPOINT_SECONDS`` says how often one is due (default 60).
    """

    def __init__(self, folder: Path):
        self.folder = folder
        self._every = _seconds()
        self._saved = time.monotonic()
        self._next: str | None = None

    def due(self) -> bool:
        """Whether it is time for the next checkpoint."""
        return time.monotonic() - self._saved >= self._every

    def save(self, step: int, arrays: dict[str, np.ndarray], state: dict[str, Any]) -> None:
        """Keep ``arrays`` and ``state`` as they are after ``step`` units of work, beside the one before."""
        plain = {name: np.asarray(array, order="C") for name, array in arrays.items()}
        body = save(plain, metadata={"step": str(step), "state": json.dumps(state)})
        slot = self._next or _other(self._newest()[0])
        write_atomically(self.folder / slot, b"".join((_MAGIC, _digest(body), body)))
        self._next = _other(slot)
        self._saved = time.monotonic()

    def load(self) -> Checkpoint | None:
        """The newest checkpoint that is whole: (step, arrays, state), or None."""
        slot, checkpoint = self._newest()
        self._next = _other(slot)
        return checkpoint

    def clear(self) -> None:
        """Remove the checkpoints: the work is finished and its output stands."""
        for slot in _SLOTS:
            (self.folder / slot).unlink(missing_ok=True)
        self._next = None

    def _newest(self) -> tuple[str, Checkpoint | None]:
        found = [(slot, checkpoint) for slot in _SLOTS if (checkpoint := _read(self.folder / slot))]
        return max(found, key=lambda entry: entry[1][0]) if found else (_SLOTS[1], None)


def _seconds() -> float:
    text = os.environ.get("ANYVIEW_CHECKPOINT_SECONDS", "60")
    try:
        seconds = float(text)
    except ValueError:
        seconds = -1
    if not seconds >= 0:
        raise AnyviewError(f"ANYVIEW_CHECKPOINT_SECONDS={text}: must be a number of at least 0")
    return seconds


def _other(slot: str) -> str:
    return _SLOTS[1 - _SLOTS.index(slot)]


def _digest(body: bytes | memoryview) -> bytes:
    return hashlib.sha256(body).hexdigest().encode() + b"\n"


def _read(path: Path) -> Checkpoint | None:
    """The checkpoint in ``path``, or None where there is no whole one."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    head = len(_MAGIC) + 65
    body = content[head:]
    if content[:head] != _MAGIC + _digest(body):
        return None
    try:
        arrays = load(body)
        metadata = json.loads(body[8 : 8 + int.from_bytes(body[:8], "little")])["__metadata__"]
        return int(metadata["step"]), arrays, json.loads(metadata["state"])
    except (SafetensorError, ValueError, KeyError, TypeError, RecursionError):
        return None
