"""How parameters move: an iteration's learning rate, and an optimiser that threads share."""

import copy
import math
from collections.abc import Callable, Sequence
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
    """An optimiser of ``model`` whose parameters are dealt out to ``count`` threads.

    Each thread moves its parameters by an optimiser of its own. No parameter's update depends on another's.
    So the result is that of one optimiser for all.

    Gradients are those of ``working``: of the model itself, or of a copy whose parameters are the model's in
    ``dtype``. So they are converted once an update, not wherever a product needs them.
    """

    def __init__(self, model: nn.Module, make: MakeOptimizer, count: int, dtype: torch.dtype = torch.float32):
        self.count, self.working = count, model
        self._parameters = list(model.parameters())
        self._copies: list[nn.Parameter] = []
        if dtype is not torch.float32:
            self.working = copy.deepcopy(model)
            self._copies = list(self.working.parameters())
            for parameter in self._copies:
                parameter.data = parameter.data.to(dtype)
        self._hands = _deal([parameter.numel() for parameter in self._parameters], count)
        self._optimizers = [make([self._parameters[n] for n in hand]) for hand in self._hands]

    def step(self, rate: float, gradients: Sequence[Gradients], pool: Executor) -> None:
        """One update at ``rate`` by the sum of ``gradients``, of all parameters for each part of a batch.

        A parameter that no part reaches, None, stays as it is. The first part's gradients are used up.
        """

        def move(number: int) -> None:
            optimizer, hand = self._optimizers[number], self._hands[number]
            for n in hand:
                self._parameters[n].grad = _sum(self._parameters[n], [part[n] for part in gradients])
            for group in optimizer.param_groups:
                group["lr"] = rate
            optimizer.step()
            self._convert(hand)

        list(pool.map(move, range(len(self._optimizers))))

    @torch.no_grad()
    def _convert(self, numbers: Sequence[int]) -> None:
        """Bring the working copy's parameters of these ``numbers`` up to date."""
        if self._copies:
            for n in numbers:
                self._copies[n].copy_(self._parameters[n])

    def arrays(self) -> dict[str, np.ndarray]:
        """The state as ``N/key`` of the parameter's number, for a checkpoint."""
        return {
            f"{hand[index]}/{key}": value.cpu().numpy()
            for hand, optimizer in zip(self._hands, self._optimizers, strict=True)
            for index, state in optimizer.state_dict()["state"].items()
            for key, value in state.items()
        }

    def restore(self, arrays: dict[str, np.ndarray]) -> None:
        """Continue from ``arrays()`` bit for bit, with a model that is as it was."""
        states: dict[int, dict[str, Tensor]] = {}
        for name, array in arrays.items():
            number, key = name.split("/")
            parameter, value = self._parameters[int(number)], torch.from_numpy(array)
            moment = value.shape == parameter.shape
            states.setdefault(int(number), {})[key] = _laid_out_as(parameter if moment else value, value)
        for hand, optimizer in zip(self._hands, self._optimizers, strict=True):
            own = {index: states[n] for index, n in enumerate(hand) if n in states}
            optimizer.load_state_dict(optimizer.state_dict() | {"state": own})
        self._convert(range(len(self._parameters)))


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
    if (total.dtype, total.stride()) != (parameter.dtype, parameter.stride()):
        total = _laid_out_as(parameter, total)
    for part in reached[1:]:
        total.add_(part)
    return total
