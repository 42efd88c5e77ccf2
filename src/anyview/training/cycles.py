"""What XIRL's embedding is trained for: frames of several clips, half of them of another body."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from anyview.config import CycleCell, Training
from anyview.embedding.cycles import cycle_loss, time_error
from anyview.embedding.network import Embedding
from anyview.embedding.weights import save_embedding
from anyview.runtime.device import products_in
from anyview.seeds import stream, torch_seed
from anyview.training.common.batches import even_parts
from anyview.video.datasets import Dataset, clip_pairs
from anyview.video.phases import frames_in_step
from anyview.video.pixels import to_input


@dataclass(frozen=True)
class ClipFrames:
    """K frames each of N clips of the experts and of N of the set's own.

    ``experts`` and ``own`` (N,) are the clips, ``expert_times`` and ``own_times`` (N, K) the frames.
    """

    experts: np.ndarray
    own: np.ndarray
    expert_times: np.ndarray
    own_times: np.ndarray

    def __len__(self) -> int:
        return len(self.own)

    def parts(self, count: int) -> list["ClipFrames"]:
        """As ``FramePairs.parts``."""
        arrays = self.experts, self.own, self.expert_times, self.own_times
        return [ClipFrames(*(array[part] for array in arrays)) for part in even_parts(len(self), count)]

    def frames(self, dataset: Dataset) -> np.ndarray:
        """The experts' frames and after them the own, uint8 (2N, K, H, W, 3)."""
        shown = dataset.expert_frames(self.experts[:, None], self.expert_times)
        return np.concatenate((shown, dataset.frames[self.own[:, None], self.own_times]))

    def times(self, dataset: Dataset) -> np.ndarray:
        """When these frames are, as parts of their clips: float32 (2N, K), 0 to 1."""
        lengths = (dataset.experts or dataset).length, dataset.length
        both = zip((self.expert_times, self.own_times), lengths, strict=True)
        return np.concatenate([times / length for times, length in both]).astype(np.float32)


class CycleObjective:
    """See ``fit.Objective``. Nothing but whole clips is known: neither pairs nor phases.

    The phases tell in validation alone whether a hand's frames lie near those of the arm that is as far.
    """

    names = ("loss",)

    def __init__(self, cell: CycleCell, training: Training, seed: int, dataset: Dataset):
        self.cell, self.training, self.seed, self.dataset = cell, training, seed, dataset
        self.dataset_names = [each.name for each in (dataset, dataset.experts) if each]

    def network(self) -> Embedding:
        """The first weights."""
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(torch_seed(self.seed, "cycles/weights"))
            return Embedding(self.dataset.image_size, self.cell.dimensions)

    def optimizer(self, parameters: list[nn.Parameter]) -> torch.optim.Optimizer:
        """Adam."""
        return torch.optim.Adam(parameters, fused=True)

    def batch(self, iteration: int) -> ClipFrames:
        """``cell.clips`` clips, half of them of the experts."""
        rng = stream(self.seed, "cycles/batch", iteration)
        experts, count = self.dataset.experts or self.dataset, self.cell.clips // 2
        shown = rng.choice(experts.split("train"), count)
        own = rng.choice(self.dataset.split("train"), count)
        times = [self._spread(rng, count, clips.length) for clips in (experts, self.dataset)]
        return ClipFrames(shown, own, *times)

    def losses(self, model: Embedding, clips: ClipFrames, iteration: int, part: int) -> Tensor:
        """The cycle loss, (1,)."""
        embedded = self._embed(model, clips)
        times = torch.from_numpy(clips.times(self.dataset)).to(embedded.device)
        return cycle_loss(embedded, times, self.cell.temperature)[None]

    def validation(self) -> list[ClipFrames]:
        """As many whole clips as ``validation_pairs`` frames make, in step, two pairs at a time."""
        length = self.dataset.length
        count = max(self.training.validation_pairs // length, 2)
        shown, own = np.array(clip_pairs(self.dataset, "validation")[:count]).T
        steps = np.broadcast_to(np.arange(length), (len(own), length))
        experts = self.dataset.experts
        in_step = steps if experts is None else np.stack([frames_in_step(experts.seconds[c]) for c in shown])
        return ClipFrames(shown, own, in_step, steps).parts(-(-len(own) // 2))

    def validation_losses(self, model: Embedding, clips: ClipFrames) -> Tensor:
        """Cycle loss and time error between an expert's clip and an own one, (2,)."""
        embedded = self._embed(model, clips)
        times = torch.from_numpy(clips.times(self.dataset)).to(embedded.device)
        loss = cycle_loss(embedded, times, self.cell.temperature)
        return torch.stack((loss, time_error(*embedded.chunk(2))))

    def validation_row(self, means: Tensor) -> dict[str, float]:
        """Both by name."""
        return dict(zip(("loss", "time_error"), means.tolist(), strict=True))

    def save(self, folder: Path, model: Embedding, meta: dict[str, Any]) -> None:
        """Write a model folder."""
        save_embedding(folder, model, meta)

    def _spread(self, rng: np.random.Generator, count: int, length: int) -> np.ndarray:
        """(count, K) frames in order, a random one in each of K equal parts of a clip."""
        frames = min(self.cell.frames, length)
        return ((np.arange(frames) + rng.random((count, frames))) * (length / frames)).astype(int)

    def _embed(self, model: Embedding, clips: ClipFrames) -> Tensor:
        """Embeddings (2N, K, D)."""
        device = next(model.parameters()).device
        frames = to_input(torch.from_numpy(clips.frames(self.dataset)).to(device))
        with products_in(self.training.precision, device):
            return model(frames.flatten(0, 1)).unflatten(0, frames.shape[:2])
