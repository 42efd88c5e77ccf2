"""One translator in training: its update step, its validation, and its state for a checkpoint."""

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from anyview.config import Training, TranslatorCell
from anyview.runtime.device import computes_bfloat16, torch_device, use_threads
from anyview.seeds import stream, torch_seed
from anyview.training.augmentation import Augmentation
from anyview.training.optimization import MakeOptimizer, SharedOptimizer, learning_rate
from anyview.training.sampling import Dataset, FramePairs, training_pairs, validation_pairs
from anyview.translator.losses import Losses, batch_losses
from anyview.translator.network import ContextTranslator, to_input
from anyview.translator.weights import restore_state, stored_state

# A batch is worked off in a fixed number of parts side by side, one thread each: the bytes do not depend on
# the number of cores, and the threads wait for each other once an iteration, not once an operation.
_PARTS = 2

_OPTIMIZERS: dict[str, MakeOptimizer] = {
    "adam": lambda parameters: torch.optim.Adam(parameters, fused=True),
    "adadelta": lambda parameters: torch.optim.Adadelta(parameters, foreach=True),
}


@dataclass(frozen=True)
class Recipe:
    """Everything that decides the weights, but for the data."""

    name: str
    cell: TranslatorCell
    training: Training
    seed: int


class Trainer:
    """Model, optimiser and best weights so far. Every random number belongs to an iteration by its index."""

    def __init__(self, recipe: Recipe, dataset: Dataset):
        self._recipe, self._dataset = recipe, dataset
        self._device = torch_device()
        self._parts = _PARTS if self._device.type == "cpu" else 1
        self._pool = ThreadPoolExecutor(self._parts)
        use_threads(1)
        with torch.random.fork_rng():
            torch.manual_seed(torch_seed(recipe.seed, "translator/weights"))
            self.model = ContextTranslator(recipe.cell.architecture, dataset.image_size)
        self.model.to(self._device).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._parameters = list(self.model.parameters())
        make = _OPTIMIZERS[recipe.cell.optimizer]
        self._optimizer = SharedOptimizer(self._parameters, make, self._parts)
        self._augmentation = Augmentation(dataset) if recipe.cell.augment else None
        rng = stream(recipe.seed, "translator/validation")
        self._validation = validation_pairs(dataset, rng, recipe.training.validation_pairs)
        self.best: dict[str, Tensor] = {}
        self.best_iteration = 0
        self.best_loss = math.inf

    def step(self, iteration: int) -> Tensor:
        """One update; returns the total loss, L_tr, L_rec and L_align (NaN where left out), shape (4,)."""
        training = self._recipe.training
        rng = stream(self._recipe.seed, "translator/pairs", iteration)
        pairs = training_pairs(self._dataset, rng, training.batch_size)
        parts = pairs.parts(self._parts)
        work = [(part, len(part) / len(pairs), iteration, index) for index, part in enumerate(parts)]
        found = list(self._pool.map(lambda unit: self._gradients(*unit), work))
        rate = learning_rate(training, iteration, self._recipe.cell.iterations)
        self._optimizer.step(rate, [gradients for _, gradients in found], self._pool)
        return torch.stack([losses for losses, _ in found]).sum(0)

    def _gradients(
        self, pairs: FramePairs, share: float, iteration: int, part: int
    ) -> tuple[Tensor, tuple[Tensor | None, ...]]:
        """What a part of a batch, the ``share`` of it, adds to the batch's losses and gradients."""
        cell, seed = self._recipe.cell, self._recipe.seed
        paired, context = self._frames(pairs)
        if self._augmentation is not None:
            rng = stream(seed, "translator/augmentation", iteration, part)
            expert, target = paired.chunk(2)
            (expert,) = self._augmentation(expert[None], pairs.sources, rng)
            context, target = self._augmentation(torch.stack((context, target)), pairs.targets, rng)
            paired = torch.cat((expert, target))
        noise = torch.Generator(self._device).manual_seed(
            torch_seed(seed, "translator/dropout", iteration, part)
        )
        with self._autocast():
            losses = batch_losses(self.model, paired, context, cell.weights, noise)
        total = losses.total(cell.weights)
        gradients = torch.autograd.grad(total * share, self._parameters, allow_unused=True)
        return torch.stack((total.detach(), *losses.parts())) * share, gradients

    @torch.no_grad()
    def validate(self, iteration: int) -> Tensor:
        """The same losses on the fixed validation pairs; keeps the weights if they are the best so far."""
        count = len(self._validation)
        parts = self._validation.parts(-(-count // self._recipe.training.batch_size))
        sums = torch.stack(list(self._pool.map(self._validation_sums, parts))).sum(0)
        means = sums.double().cpu() / count
        total = Losses(*means).total(self._recipe.cell.weights)
        if total < self.best_loss:
            self.best_loss, self.best_iteration = float(total), iteration
            self.best = {name: value.clone() for name, value in stored_state(self.model).items()}
        return torch.stack((total, *means))

    @torch.no_grad()  # the mode is each thread's own
    def _validation_sums(self, pairs: FramePairs) -> Tensor:
        with self._autocast():
            losses = batch_losses(self.model, *self._frames(pairs))
        return torch.stack(losses.parts()) * len(pairs)

    def best_model(self) -> ContextTranslator:
        """A translator with the best weights."""
        model = ContextTranslator(self._recipe.cell.architecture, self._dataset.image_size)
        restore_state(model, self.best)
        return model

    def arrays(self) -> dict[str, np.ndarray]:
        """Model, optimiser and best weights, for a checkpoint."""
        arrays = {f"model/{name}": value.numpy() for name, value in stored_state(self.model).items()}
        arrays |= {f"best/{name}": value.numpy() for name, value in self.best.items()}
        return arrays | {f"optimizer/{name}": value for name, value in self._optimizer.arrays().items()}

    def restore(self, arrays: dict[str, np.ndarray], best_iteration: int, best_loss: float) -> None:
        """Continue from ``arrays()`` bit for bit."""
        groups: dict[str, dict[str, np.ndarray]] = {"model": {}, "best": {}, "optimizer": {}}
        for name, array in arrays.items():
            kind, rest = name.split("/", 1)
            groups[kind][rest] = array
        model, best = (
            {k: torch.from_numpy(a) for k, a in groups[kind].items()} for kind in ("model", "best")
        )
        restore_state(self.model, model)
        self.best, self.best_iteration, self.best_loss = best, best_iteration, best_loss
        self._optimizer.restore(groups["optimizer"])

    def _frames(self, pairs: FramePairs) -> tuple[Tensor, Tensor]:
        """o_t^i and after them o_t^j (2N, 3, H, W), and o_0^j (N, 3, H, W): what ``batch_losses`` takes."""
        paired, context = (
            to_input(torch.from_numpy(frames).to(self._device)) for frames in pairs.frames(self._dataset)
        )
        return paired, context

    def _autocast(self) -> torch.autocast:
        wanted = self._recipe.training.precision == "bfloat16"
        reduced = wanted and computes_bfloat16(self._device)
        # All threads share the cache of converted weights: what a part found there would be up to chance.
        return torch.autocast(self._device.type, torch.bfloat16, enabled=reduced, cache_enabled=False)
