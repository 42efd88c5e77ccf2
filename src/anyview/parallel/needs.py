"""What a stage needs while it runs, and what there is: cores, GPUs and memory."""

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil

from anyview.runtime.errors import AnyviewError

_UNITS = {"KB": 1e3, "MB": 1e6, "GB": 1e9, "TB": 1e12}
_DRIVER = Path("/proc/driver/nvidia/gpus")  # a folder in it for each GPU of this machine


@dataclass(frozen=True)
class Needs:
    """What a stage keeps busy: ``cores`` at most, ``gpus`` of its own, ``memory`` in bytes."""

    cores: int = 1
    gpus: int = 0
    memory: int = 0

    def on(self, cores: int) -> "Needs":
        """The same where there are only ``cores`` cores: a stage makes do with all there are."""
        return Needs(min(self.cores, cores), self.gpus, self.memory)


def read_needs(meta: Any, stage: str) -> Needs:
    """The needs that ``meta`` of ``stage`` in dvc.yaml states: ``{cores: 2, gpus: 1, memory: 4 GB}``.

    Other keys of ``meta`` belong to others. Raises AnyviewError if a value is not possible.
    """
    stated = meta if isinstance(meta, Mapping) else {}
    return Needs(
        _count(stated.get("cores", 1), 1, "cores", stage),
        _count(stated.get("gpus", 0), 0, "gpus", stage),
        _bytes(stated.get("memory", 0), stage),
    )


def _count(value: Any, least: int, key: str, stage: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise AnyviewError(f"stage {stage}: meta.{key}={value}: must be a whole number of at least {least}")
    return value


def _bytes(value: Any, stage: str) -> int:
    found = re.fullmatch(r"(\d+(?:\.\d+)?) ?([KMGT]B)", str(value).strip())
    if value and not found:
        raise AnyviewError(f"stage {stage}: meta.memory={value}: must be a size such as 500 MB or 4 GB")
    return int(float(found[1]) * _UNITS[found[2]]) if found else 0


class Machine:
    """What is free of this machine, or of one that a plan imagines. GPUs are told apart by their names."""

    def __init__(self, cores: int, gpus: tuple[str, ...] = (), memory: float = float("inf")):
        self.cores = self._cores = cores
        self._gpus = list(gpus)
        self._memory = memory
        self._whole = (len(gpus), memory)

    def check(self, needs: Needs, stage: str) -> None:
        """Raise AnyviewError if ``stage`` could never run here."""
        gpus, memory = self._whole
        if needs.gpus > gpus:
            raise AnyviewError(f"stage {stage}: meta.gpus={needs.gpus}, and this machine has {gpus}")
        if needs.memory > memory:
            raise AnyviewError(
                f"stage {stage}: meta.memory={needs.memory / 1e9:.1f} GB, and this machine has "
                f"{memory / 1e9:.1f} GB"
            )

    def fits(self, needs: Needs) -> bool:
        """Whether ``needs`` are free now."""
        free = (self._cores, len(self._gpus), self._memory)
        wanted = (needs.on(self.cores).cores, needs.gpus, needs.memory)
        return all(want <= there for want, there in zip(wanted, free, strict=True))

    def take(self, needs: Needs) -> tuple[str, ...]:
        """Use what ``fits``; returns the GPUs."""
        self._cores -= needs.on(self.cores).cores
        self._memory -= needs.memory
        return tuple(self._gpus.pop(0) for _ in range(needs.gpus))

    def give(self, needs: Needs, gpus: tuple[str, ...]) -> None:
        """Free what ``take`` returned."""
        self._cores += needs.on(self.cores).cores
        self._memory += needs.memory
        self._gpus.extend(gpus)


def this_machine(cores: int) -> Machine:
    """This machine, of which stages use ``cores`` cores together."""
    stated = os.environ.get("CUDA_VISIBLE_DEVICES")
    if stated is not None:
        gpus = tuple(name.strip() for name in stated.split(",") if name.strip())
    else:
        gpus = tuple(map(str, range(len(list(_DRIVER.glob("*"))))))
    return Machine(cores, gpus, psutil.virtual_memory().total)
