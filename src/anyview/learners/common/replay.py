"""Replay: the newest transitions of R runs, in memory allocated once."""

import torch
from torch import Tensor


class Replay:
    """Per run, the newest ``capacity`` rows of width W, (R, capacity, W), overwritten from the oldest on."""

    def __init__(self, runs: int, capacity: int, width: int, device: torch.device):
        self._rows = torch.zeros(runs, capacity, width, device=device)
        self._run = torch.arange(runs, device=device)[:, None]
        self.written = 0

    @property
    def size(self) -> int:
        """Rows held of each run."""
        return min(self.written, self._rows.shape[1])

    def add(self, rows: Tensor) -> None:
        """Append ``rows`` (R, N, W), N at most the capacity."""
        count, capacity = rows.shape[1], self._rows.shape[1]
        places = (self.written + torch.arange(count, device=rows.device)) % capacity
        self._rows[:, places] = rows
        self.written += count

    def take(self, ages: Tensor) -> Tensor:
        """Rows (R, B, W) by ``ages`` (R, B): 0 is the newest row, ``size - 1`` the oldest."""
        return self._rows[self._run, (self.written - 1 - ages) % self._rows.shape[1]]

    def rewrite(self, column: int, values: Tensor) -> None:
        """Put ``values`` (R, N) into ``column`` of the newest N rows, the oldest of them first."""
        count, capacity = values.shape[1], self._rows.shape[1]
        places = (self.written - count + torch.arange(count, device=values.device)) % capacity
        self._rows[:, places, column] = values

    def contents(self) -> Tensor:
        """The rows held (R, size, W) as they lie in memory, for a checkpoint."""
        return self._rows[:, : self.size]

    def restore(self, contents: Tensor, written: int) -> None:
        """Continue from ``contents()`` and ``written``."""
        self._rows[:, : contents.shape[1]] = contents
        self.written = written
