"""What a context translator is trained for: the losses of pairs of frames that the cell weighs."""

from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from anyview.config import Training, TranslatorCell
from anyview.runtime.device import products_in
from anyview.seeds import stream, torch_seed
from anyview.training.augmentation import Augmentation
from anyview.training.common.batches import FramePairs, training_pairs, validation_pairs
from anyview.training.common.optimization import MakeOptimizer
from anyview.translator.losses import NAMES, Losses, batch_losses
from anyview.translator.network import ContextTranslator, task_frames
from anyview.translator.weights import save_translator
from anyview.video.datasets import Dataset
from anyview.video.pixels import to_input

_OPTIMIZERS: dict[str, MakeOptimizer] = {
    "adam": lambda parameters: torch.optim.Adam(parameters, fused=True),
    "adadelta": lambda parameters: torch.optim.Adadelta(parameters, foreach=True),
}


class TranslatorObjective:
    """See ``fit.Objective``. Losses: L, L_tr, L_rec and L_align, NaN where the cell leaves one out."""

    names = ("loss", *NAMES)

    def __init__(self, cell: TranslatorCell, training: Training, seed: int, dataset: Dataset):
        self.cell, self.training, self.seed, self.dataset = cell, training, seed, dataset
        self.optimizer = _OPTIMIZERS[cell.optimizer]
        self._augmentation = Augmentation(dataset) if cell.augment else None

    def network(self) -> ContextTranslator:
        """With the same first weights for every cell of an architecture: ablations differ in losses alone."""
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(torch_seed(self.seed, "translator/weights"))
            model = ContextTranslator(
                self.cell.architecture, self.dataset.image_size, self.cell.task_embedding
            )
        return model.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def batch(self, iteration: int) -> FramePairs:
        """``batch_size`` pairs of one frame each."""
        rng = stream(self.seed, "translator/pairs", iteration)
        return training_pairs(self.dataset, rng, self.training.batch_size)

    def losses(self, model: ContextTranslator, pairs: FramePairs, iteration: int, part: int) -> Tensor:
        """(4,), with dropout and augmentation."""
        device = next(model.parameters()).device
        paired, context, clip = self._frames(pairs, device)
        if self._augmentation is not None:
            rng = stream(self.seed, "translator/augmentation", iteration, part)
            expert, target = paired.chunk(2)
            shown = expert[None] if clip is None else torch.cat((expert[None], clip.transpose(0, 1)))
            expert, *others = self._augmentation(shown, pairs.sources, rng)
            clip = torch.stack(others, dim=1) if others else None
            context, target = self._augmentation(torch.stack((context, target)), pairs.targets, rng)
            paired = torch.cat((expert, target))
        seed = torch_seed(self.seed, "translator/dropout", iteration, part)
        noise = torch.Generator(device).manual_seed(seed)
        with products_in(self.training.precision, device):
            losses = batch_losses(model, paired, context, clip, self.cell.weights, noise)
        return torch.stack((losses.total(self.cell.weights), *losses.parts()))

    def validation(self) -> list[FramePairs]:
        """``validation_pairs`` pairs, a batch at a time."""
        count = self.training.validation_pairs
        pairs = validation_pairs(self.dataset, stream(self.seed, "translator/validation"), count)
        return pairs.parts(-(-count // self.training.batch_size))

    def validation_losses(self, model: ContextTranslator, pairs: FramePairs) -> Tensor:
        """L_tr, L_rec and L_align, (3,)."""
        device = next(model.parameters()).device
        with products_in(self.training.precision, device):
            losses = batch_losses(model, *self._frames(pairs, device))
        return torch.stack(losses.parts())

    def validation_row(self, means: Tensor) -> dict[str, float]:
        """L of the losses that the cell weighs, and all three."""
        total = float(Losses(*means).total(self.cell.weights))
        return {"loss": total} | dict(zip(NAMES, means.tolist(), strict=True))

    def save(self, folder: Path, model: ContextTranslator, meta: dict[str, Any]) -> None:
        """Write a model folder."""
        save_translator(folder, model, meta)

    def _frames(self, pairs: FramePairs, device: torch.device) -> tuple[Tensor, Tensor, Tensor | None]:
        """o_t^i, o_t^j (2N, 3, H, W); o_0^j (N, 3, H, W); frames of the clips i to embed (N, K, 3, H, W)."""

        def load(frames: np.ndarray) -> Tensor:
            return to_input(torch.from_numpy(frames).to(device))

        clip = None
        if self.cell.task_embedding:
            clip = load(pairs.clips(self.dataset, task_frames(self.dataset.length)))
        return load(pairs.frames(self.dataset)), load(pairs.contexts(self.dataset)), clip
