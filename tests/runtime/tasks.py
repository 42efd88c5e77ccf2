"""Tasks for the tests of workers, in a module that worker processes can import."""

import os
import time
from pathlib import Path

import numpy as np

from anyview.runtime.errors import AnyviewError
from anyview.seeds import stream


def hold(folder: str, number: int) -> None:
    """Leave one's process id in ``folder`` and sleep."""
    (Path(folder) / str(os.getpid())).touch()
    time.sleep(60)


def queue(gate: str, number: int) -> int:
    """The first passes; the others wait until the file ``gate`` exists."""
    while number and not Path(gate).exists():
        time.sleep(0.01)
    return number


def draw(number: int) -> bytes:
    """Some arithmetic that depends on a stream of its own."""
    return np.linalg.inv(stream(1, "task", number).normal(size=(60, 60))).tobytes()


def refuse(number: int) -> int:
    """A user error in the third task."""
    if number == 2:
        raise AnyviewError("clip-2.avi: cut short")
    return number


def die(number: int) -> int:
    """A worker that the kernel kills."""
    if number == 1:
        os.kill(os.getpid(), 9)
    return number


def mark(values: np.ndarray, number: int) -> int:
    """Write into a large array, which is the task's own."""
    values[0] = number
    return int(values.sum())
