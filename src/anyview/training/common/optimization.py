"""How parameters move: an iteration's learning rate, and an optimiser that threads share."""

import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor

import numpy as np
import torch
from torch import Tensor, nn

from anyview.config import Training

MakeOptimizer = Callable[[list[nn.Parameter]], torch.optim.Optimizer]
Gradients = Sequence[Tensor | None]


def learning_rate(training: Training, iteration: int, iterations: int) -> float:
    """The rate of an iteration: constant, or half a cosine from ``learning_rate`` down to 0."""
    if training.schedule == "constant":
        return training.learning_rate
    return training.learning_rate * (1 + math.cos(math.pi * iteration / iterations)) / 2


class SharedOptimizer:
    """An optimiser whose parameters are dealt out to ``count`` threads.

    Each thread moves its parameters by an optimiser of its own. No parameter's update depends on another's.
    So the result is that of one optimiser for all.
    """

    def __init__(self, parameters: Iterable[nn.Parameter], make: MakeOptimizer, count: int):
        self.count = count
        self._parameters = list(parameters)
        self._hands = _deal([parameter.numel() for parameter in self._parameters], count)
        self._optimizers = [make([self._parameters[n] for n in hand]) for hand in self._hands]

    def step(self, rate: float, gradients: Sequence[Gradients], pool: Executor) -> None:
        """One update at ``rate`` by the sum of ``gradients``, of all parameters for each part of a batch.

        A parameter that no part reaches, None, stays as it is. The first part's gradients are used up.
        """

        def move(number: int) -> None:
            optimizer = self._optimizers[number]
            for n in self._hands[number]:
                self._parameters[n].grad = _sum(self._parameters[n], [part[n] for part in gradients])
            for group in optimizer.param_groups:
                group["lr"] = rate
            optimizer.step()

        list(pool.map(move, range(len(self._optimizers))))

    def arrays(self) -> dict[str, np.ndarray]:
        """The state as ``N/key`` of the parameter's number, for a checkpoint."""
        return {
            f"{hand[index]}/{key}": value.cpu().numpy()
            for hand, optimizer in zip(self._hands, self._optimizers, strict=True)
            for index, state in optimizer.state_dict()["state"].items()
            for key, value in state.items()
        }

    def restore(self, arrays: dict[str, np.ndarray]) -> None:
        """Continue from ``arrays()`` bit for bit."""
        states: dict[int, dict[str, Tensor]] = {}
        for name, array in arrays.items():
            number, key = name.split("/")
            parameter, value = self._parameters[int(number)], torch.from_numpy(array)
            moment = value.shape == parameter.shape
            states.setdefault(int(number), {})[key] = _laid_out_as(parameter if moment else value, value)
        for hand, optimizer in zip(self._hands, self._optimizers, strict=True):
            own = {index: states[n] for index, n in enumerate(hand) if n in states}
            optimizer.load_state_dict(optimizer.state_dict() | {"state": own})


def _deal(sizes: list[int], count: int) -> list[list[int]]:
    """The numbers of all parameters in ``count`` hands of about equal size, the largest dealt first."""
    hands: list[list[int]] = [[] for _ in range(count)]
    for n in sorted(range(len(sizes)), key=lambda n: -sizes[n]):
        min(hands, key=lambda hand: sum(sizes[m] for m in hand)).append(n)
    return hands


def _laid_out_as(like: Tensor, value: Tensor) -> Tensor:
    """A copy with the strides of ``like``, a parameter: the fused optimiser takes them for granted."""
    return torch.empty_like(like).copy_(value)


def _sum(parameter: Tensor, gradients: Gradients) -> Tensor | None:
    """The gradient of a batch from those of its parts; None where the loss does not reach the parameter."""
    reached = [gradient for gradient in gradients if gradient is not None]
    if not reached:
        return None
    total = reached[0]
    if total.stride() != parameter.stride():
        total = _laid_out_as(parameter, total)
    for part in reached[1:]:
        total.add_(part)
    return total
