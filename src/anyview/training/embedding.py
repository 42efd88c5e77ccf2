"""What the time-contrastive embedding is trained for: triplets of frames from two clips."""

from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from anyview.config import EmbeddingCell, Training
from anyview.embedding.losses import time_error, triplet_loss
from anyview.embedding.network import Embedding
from anyview.embedding.weights import save_embedding
from anyview.runtime.device import products_in
from anyview.seeds import stream, torch_seed
from anyview.training.common.batches import FramePairs, training_triplets, validation_triplets
from anyview.video.datasets import Dataset
from anyview.video.pixels import to_input

_TIMES = 10  # of a clip in a batch; each is compared with every other


class EmbeddingObjective:
    """See ``fit.Objective``. A pair is two clips at several times."""

    names = ("loss",)

    def __init__(self, cell: EmbeddingCell, training: Training, seed: int, dataset: Dataset):
        self.cell, self.training, self.seed, self.dataset = cell, training, seed, dataset
        self.dataset_names = [dataset.name]

    def network(self) -> Embedding:
        """The first weights."""
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(torch_seed(self.seed, "embedding/weights"))
            return Embedding(self.dataset.image_size, self.cell.dimensions)

    def optimizer(self, parameters: list[nn.Parameter]) -> torch.optim.Optimizer:
        """Adam."""
        return torch.optim.Adam(parameters, fused=True)

    def batch(self, iteration: int) -> FramePairs:
        """``batch_size`` frames of either view: pairs of clips at up to 10 times."""
        rng = stream(self.seed, "embedding/batch", iteration)
        times = min(_TIMES, self.dataset.length)
        return training_triplets(self.dataset, rng, max(self.training.batch_size // times, 1), times)

    def losses(self, model: Embedding, pairs: FramePairs, iteration: int, part: int) -> Tensor:
        """The triplet loss, (1,)."""
        return triplet_loss(*self._embed(model, pairs), self.cell.margin)[None]

    def validation(self) -> list[FramePairs]:
        """As many whole clips as ``validation_pairs`` frames make, a pair of clips at a time."""
        count = max(self.training.validation_pairs // self.dataset.length, 1)
        pairs = validation_triplets(self.dataset, count)
        return pairs.parts(len(pairs))

    def validation_losses(self, model: Embedding, pairs: FramePairs) -> Tensor:
        """Triplet loss and time error, (2,)."""
        embedded = self._embed(model, pairs)
        return torch.stack((triplet_loss(*embedded, self.cell.margin), time_error(*embedded)))

    def validation_row(self, means: Tensor) -> dict[str, float]:
        """Both by name."""
        return dict(zip(("loss", "time_error"), means.tolist(), strict=True))

    def save(self, folder: Path, model: Embedding, meta: dict[str, Any]) -> None:
        """Write a model folder."""
        save_embedding(folder, model, meta)

    def _embed(self, model: Embedding, pairs: FramePairs) -> tuple[Tensor, Tensor]:
        """Embeddings (N, K, D) of the clips i and the clips j."""
        device = next(model.parameters()).device
        frames = to_input(torch.from_numpy(pairs.frames(self.dataset)).to(device))
        with products_in(self.training.precision, device):
            embedded = model(frames.flatten(0, 1))
        one, other = embedded.unflatten(0, frames.shape[:2]).chunk(2)
        return one, other
