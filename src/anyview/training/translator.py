"""What a context translator is trained for: the losses of pairs of frames that the cell weighs."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from anyview.config import Training, TranslatorCell
from anyview.runtime.device import products_in
from anyview.runtime.errors import AnyviewError
from anyview.seeds import stream, torch_seed
from anyview.training.augmentation import Augmentation, mirror
from anyview.training.common.batches import FramePairs, training_pairs, training_views, validation_pairs
from anyview.training.common.optimization import MakeOptimizer
from anyview.translator.architectures import Translator, make_translator
from anyview.translator.losses import NAMES, Losses, Marks, batch_losses
from anyview.translator.weights import save_translator
from anyview.video.datasets import Dataset, open_dataset
from anyview.video.pixels import to_input

_OPTIMIZERS: dict[str, MakeOptimizer] = {
    "adam": lambda parameters: torch.optim.Adam(parameters, fused=True),
    # TensorFlow 2's beside its rate, 0.001, the one that the thesis states; PyTorch's own are 0.9 and 1e-6.
    "adadelta": lambda parameters: torch.optim.Adadelta(parameters, rho=0.95, eps=1e-7, foreach=True),
}


def open_learnt(cell: TranslatorCell) -> tuple[Dataset, Dataset | None]:
    """The cell's data set, with that of its experts, and what it pretrains on."""
    dataset = open_dataset(cell.dataset, cell.other_experts)
    if not cell.pretraining.iterations:
        return dataset, None
    first = open_dataset(cell.pretraining.dataset)
    return dataset, replace(dataset, experts=first) if cell.other_experts else first


class TranslatorObjective:
    """See ``fit.Objective``. Losses: L, L_tr, L_rec and L_align, NaN where the cell leaves one out.

    The first ``cell.pretraining.iterations`` learn from the data set ``pretraining``, the others from
    ``dataset``, which also validates from the start. Raises AnyviewError if their frames differ in size,
    or if nothing teaches the places that the cell weighs.
    """

    names = ("loss", *NAMES)

    def __init__(
        self,
        cell: TranslatorCell,
        training: Training,
        seed: int,
        dataset: Dataset,
        pretraining: Dataset | None = None,
    ):
        self.cell, self.seed, self.dataset = cell, seed, dataset
        self._pretraining = pretraining or dataset
        if self._pretraining.image_size != dataset.image_size:
            sizes = f"{self._pretraining.image_size} and {dataset.image_size} pixels"
            raise AnyviewError(f"data sets {self._pretraining.name} and {dataset.name}: frames of {sizes}")
        if cell.weights.places and all(learnt.marks is None for learnt in self._learnt()):
            raise AnyviewError(f"data set {dataset.name}: no marks, which the weight of places needs")
        own = {key: getattr(cell, key) for key in ("batch_size", "learning_rate", "schedule")}
        self.training = training.model_copy(update={key: value for key, value in own.items() if value})
        self.optimizer = _OPTIMIZERS[cell.optimizer]
        self._augmentations = (
            {learnt.name: Augmentation(learnt) for learnt in self._learnt()} if cell.augment else {}
        )

    @property
    def dataset_names(self) -> list[str]:
        """Of the sets of clips that the training reads."""
        learnt = self._learnt()
        return [dataset.name for dataset in (*learnt, *(each.experts for each in learnt)) if dataset]

    def network(self) -> Translator:
        """With the same first weights for every cell of an architecture: ablations differ in losses alone."""
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(torch_seed(self.seed, "translator/weights"))
            model = make_translator(self.cell.architecture, self.dataset.image_size, self.cell.task_embedding)
        return model.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def batch(self, iteration: int) -> FramePairs:
        """``batch_size`` pairs of one frame each."""
        rng = stream(self.seed, "translator/pairs", iteration)
        draw = {"any": training_pairs, "views": training_views}[self.cell.pairs]
        return draw(self._learnt_at(iteration), rng, self.training.batch_size)

    def losses(self, model: Translator, pairs: FramePairs, iteration: int, part: int) -> Tensor:
        """(4,), with dropout and augmentation. L has L_places in it where the cell weighs that."""
        device = next(model.parameters()).device
        dataset = self._learnt_at(iteration)
        paired, context, clip = self._frames(model, dataset, pairs)
        marks = self._marks(dataset, pairs, device)
        if self.cell.mirror:
            rng = stream(self.seed, "translator/mirror", iteration, part)
            paired, context, clip, marks = mirror(paired, context, clip, marks, rng)
        if augmentation := self._augmentations.get(dataset.name):
            rng = stream(self.seed, "translator/augmentation", iteration, part)
            expert, target = paired.chunk(2)
            shown = expert[None] if clip is None else torch.cat((expert[None], clip.transpose(0, 1)))
            expert, *others = augmentation(shown, pairs.sources, rng)
            clip = torch.stack(others, dim=1) if others else None
            context, target = augmentation(torch.stack((context, target)), pairs.targets, rng)
            paired = torch.cat((expert, target))
        seed = torch_seed(self.seed, "translator/dropout", iteration, part)
        noise = torch.Generator(device).manual_seed(seed)
        with products_in(self.training.precision, device):
            losses = batch_losses(model, paired, context, clip, self.cell.weights, noise, marks)
        return torch.stack((losses.total(self.cell.weights), *losses.parts()))

    def validation(self) -> list[FramePairs]:
        """``validation_pairs`` pairs, a batch at a time."""
        count = self.training.validation_pairs
        pairs = validation_pairs(self.dataset, stream(self.seed, "translator/validation"), count)
        return pairs.parts(-(-count // self.training.batch_size))

    def validation_losses(self, model: Translator, pairs: FramePairs) -> Tensor:
        """L_tr, L_rec and L_align, (3,)."""
        device = next(model.parameters()).device
        with products_in(self.training.precision, device):
            losses = batch_losses(model, *self._frames(model, self.dataset, pairs))
        return torch.stack(losses.parts())

    def validation_row(self, means: Tensor) -> dict[str, float]:
        """L of the losses that the cell weighs, and all three."""
        total = float(Losses(*means).total(self.cell.weights))
        return {"loss": total} | dict(zip(NAMES, means.tolist(), strict=True))

    def save(self, folder: Path, model: Translator, meta: dict[str, Any]) -> None:
        """Write a model folder; its description names the set of the ``experts`` if it is another."""
        experts = self.cell.other_experts
        save_translator(folder, model, meta | ({"experts": experts} if experts else {}))

    def _learnt(self) -> list[Dataset]:
        return [self._pretraining, self.dataset] if self.cell.pretraining.iterations else [self.dataset]

    def _learnt_at(self, iteration: int) -> Dataset:
        first = self.cell.pretraining
        rehearsed = first.rehearsed and (iteration - first.iterations) % 2 == 1
        return self._pretraining if iteration < first.iterations or rehearsed else self.dataset

    def _frames(
        self, model: Translator, dataset: Dataset, pairs: FramePairs
    ) -> tuple[Tensor, Tensor, Tensor | None]:
        """o_t^i, o_t^j (2N, 3, H, W); o_0^j (N, 3, H, W); frames of the clips i to embed (N, K, 3, H, W)."""
        device = next(model.parameters()).device

        def load(frames: np.ndarray) -> Tensor:
            return to_input(torch.from_numpy(frames).to(device))

        steps = model.task_frames((dataset.experts or dataset).length)
        clip = load(pairs.clips(dataset, steps)) if len(steps) else None
        return load(pairs.frames(dataset)), load(pairs.contexts(dataset)), clip

    def _marks(self, dataset: Dataset, pairs: FramePairs, device: torch.device) -> Marks | None:
        """Where the cell weighs L_places and the set has marks."""
        found = pairs.marks(dataset) if self.cell.weights.places else None
        if found is None:
            return None
        in_units = [
            (2 * torch.from_numpy(pixels).to(device) + 1) / dataset.image_size - 1 for pixels in found
        ]
        return Marks(*in_units)
