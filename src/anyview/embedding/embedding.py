"""Time-contrastive embedding (Sermanet et al. 2018): no translation, a feature space in which views agree.

Frames of the same time in two clips are drawn together, frames of other times are pushed apart by a margin.
Clips share their time profile but neither camera nor object nor goal, so what views agree on is how far the
task has come. It is the model of the `tcn` baseline, whose reward is a distance in this space.
"""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
from safetensors import SafetensorError
from safetensors.torch import load, save
from torch import Tensor, nn
from torch.nn import functional as F

from anyview import paths
from anyview.config import EmbeddingCell, Training
from anyview.runtime.checkpoints import Checkpoints
from anyview.runtime.device import computes_bfloat16, torch_device, use_threads
from anyview.runtime.errors import AnyviewError
from anyview.runtime.outputs import whole_folder, write_atomically
from anyview.runtime.progress import track
from anyview.runtime.scratch import content_key, scratch_folder
from anyview.seeds import stream, torch_seed
from anyview.training.sampling import Dataset, clip_pairs, open_dataset
from anyview.translator.network import to_input

_CHANNELS = (16, 32, 64, 64)
_HIDDEN = 128
_LEAK = 0.2
_TIMES = 10  # of a clip in a batch; each is compared with every other
_THREADS = 2  # fixed: reductions are split by it, so the weights do not depend on the machine
_WEIGHTS = "weights.safetensors"
_MODEL = "model.json"
_LARGEST = 1024  # pixels and dimensions: a file that asks for more is damaged, and would take all the memory


class Embedding(nn.Module):
    """Four convolutions and two connected layers: (N, 3, H, W) in [-1, 1] -> unit vectors (N, D)."""

    def __init__(self, image_size: int, dimensions: int):
        super().__init__()
        self.image_size, self.dimensions = image_size, dimensions
        layers: list[nn.Module] = []
        before, side = 3, image_size
        for channels in _CHANNELS:
            layers += [nn.Conv2d(before, channels, 5, stride=2, padding=2), nn.LeakyReLU(_LEAK)]
            before, side = channels, -(-side // 2)
        connected = [
            nn.Linear(before * side**2, _HIDDEN),
            nn.LeakyReLU(_LEAK),
            nn.Linear(_HIDDEN, dimensions),
        ]
        self.layers = nn.Sequential(*layers, nn.Flatten(), *connected)

    def forward(self, frames: Tensor) -> Tensor:
        return F.normalize(self.layers(frames).float(), dim=-1)


def squared_distances(one: Tensor, other: Tensor) -> Tensor:
    """|e_a - e_b|^2 (P, K, L) between unit vectors (P, K, D) and (P, L, D)."""
    return 2 - 2 * one @ other.mT


def triplet_loss(anchors: Tensor, others: Tensor, margin: float) -> Tensor:
    """Mean of max(0, |a_t - b_t|^2 - |a_t - b_s|^2 + margin) over pairs of clips and times s other than t.

    ``anchors`` a and ``others`` b are (P, K, D): P pairs of clips at the same K times.
    """
    distances = squared_distances(anchors, others)
    positive = distances.diagonal(dim1=1, dim2=2)[:, :, None]
    hinge = F.relu(positive - distances + margin)
    count = hinge.shape[0] * hinge.shape[1] * (hinge.shape[1] - 1)
    return (hinge.sum() - margin * hinge.shape[0] * hinge.shape[1]) / count


def time_error(anchors: Tensor, others: Tensor) -> Tensor:
    """Mean |s - t| / T, where b_s is the frame of ``others`` (P, T, D) nearest to a_t of ``anchors``.

    Guessing gives about 1/3.
    """
    nearest = squared_distances(anchors, others).argmin(-1)
    times = torch.arange(anchors.shape[1], device=anchors.device)
    return (nearest - times).abs().float().mean() / anchors.shape[1]


class Trainer:
    """Embedding, optimiser and best weights so far. Every random number belongs to an iteration."""

    def __init__(self, cell: EmbeddingCell, training: Training, seed: int, dataset: Dataset):
        self._cell, self._training, self._seed, self._dataset = cell, training, seed, dataset
        self._device = torch_device()
        self._times = min(_TIMES, dataset.length)
        use_threads(_THREADS)
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(torch_seed(seed, "embedding/weights"))
            self.model = Embedding(dataset.image_size, cell.dimensions)
        self.model.to(self._device)
        self._optimizer = torch.optim.Adam(self.model.parameters(), training.learning_rate)
        wanted = max(training.validation_pairs // dataset.length, 1)
        self._validation = np.array(clip_pairs(dataset, "validation")[:wanted])
        self.best: dict[str, Tensor] = {}
        self.best_iteration = 0
        self.best_loss = math.inf

    def step(self, iteration: int) -> float:
        """One update on ``batch_size`` frames of either view; returns the loss."""
        rng = stream(self._seed, "embedding/batch", iteration)
        clips = self._dataset.split("train")
        pairs = max(self._training.batch_size // self._times, 1)
        chosen = np.stack([rng.choice(clips, 2, replace=False) for _ in range(pairs)])
        times = np.stack([rng.permutation(self._dataset.length)[: self._times] for _ in range(pairs)])
        loss = triplet_loss(*self._embed(chosen, times), self._cell.margin)
        for group in self._optimizer.param_groups:
            group["lr"] = self._rate(iteration)
        self._optimizer.zero_grad()
        loss.backward()
        self._optimizer.step()
        return loss.item()

    def _rate(self, iteration: int) -> float:
        falling = (1 + math.cos(math.pi * iteration / self._cell.iterations)) / 2
        return self._training.learning_rate * (falling if self._training.schedule == "cosine" else 1.0)

    def _embed(self, pairs: np.ndarray, times: np.ndarray) -> tuple[Tensor, Tensor]:
        """Embeddings (P, K, D) of both clips of ``pairs`` (P, 2) at ``times`` (P, K)."""
        frames = self._dataset.frames[pairs.T[:, :, None], times]  # (2, P, K, H, W, 3)
        inputs = to_input(torch.from_numpy(frames).to(self._device))
        reduced = self._training.precision == "bfloat16" and computes_bfloat16(self._device)
        with torch.autocast(self._device.type, torch.bfloat16, enabled=reduced):
            embedded = self.model(inputs.flatten(0, 2))
        one, other = embedded.unflatten(0, frames.shape[:3])
        return one, other

    @torch.no_grad()
    def validate(self, iteration: int) -> tuple[float, float]:
        """Loss and time error over whole validation clips; keeps the weights with the lowest loss so far."""
        times = np.broadcast_to(
            np.arange(self._dataset.length), (len(self._validation), self._dataset.length)
        )
        embedded = self._embed(self._validation, times)
        loss = triplet_loss(*embedded, self._cell.margin).item()
        if loss < self.best_loss:
            self.best_loss, self.best_iteration = loss, iteration
            self.best = {name: value.cpu().clone() for name, value in self.model.state_dict().items()}
        return loss, time_error(*embedded).item()

    def best_model(self) -> Embedding:
        """An embedding with the best weights, on the CPU."""
        model = Embedding(self._dataset.image_size, self._cell.dimensions)
        model.load_state_dict(self.best)
        return model

    def arrays(self) -> dict[str, np.ndarray]:
        """Model, optimiser and best weights, for a checkpoint."""
        arrays = {f"model/{name}": value.cpu().numpy() for name, value in self.model.state_dict().items()}
        arrays |= {f"best/{name}": value.numpy() for name, value in self.best.items()}
        for index, state in self._optimizer.state_dict()["state"].items():
            arrays |= {f"optimizer/{index}/{key}": value.cpu().numpy() for key, value in state.items()}
        return arrays

    def restore(self, arrays: dict[str, np.ndarray], best_iteration: int, best_loss: float) -> None:
        """Continue from ``arrays()`` bit for bit."""
        groups: dict[str, dict[str, Tensor]] = {"model": {}, "best": {}, "optimizer": {}}
        for name, array in arrays.items():
            kind, rest = name.split("/", 1)
            groups[kind][rest] = torch.tensor(array)
        self.model.load_state_dict(groups["model"])
        self.best, self.best_iteration, self.best_loss = groups["best"], best_iteration, best_loss
        state: dict[int, dict[str, Tensor]] = {}
        for name, value in groups["optimizer"].items():
            index, key = name.split("/")
            state.setdefault(int(index), {})[key] = value
        self._optimizer.load_state_dict(self._optimizer.state_dict() | {"state": state})


def train_embedding(name: str, cell: EmbeddingCell, training: Training, seed: int, output: Path) -> None:
    """Train a cell into the model folder ``output``; continues where an interrupted training stopped.

    The folder holds ``weights.safetensors`` and ``model.json`` of the weights with the lowest validation
    loss, and ``curve.csv``: ``iteration, loss, validation_loss, validation_time_error``, a row for each
    validation.
    Raises AnyviewError when the loss is no longer finite.
    """
    dataset = open_dataset(cell.dataset)
    checkpoints = Checkpoints(scratch_folder("checkpoints", _key(name, cell, training, seed)))
    run = Trainer(cell, training, seed, dataset)
    rows: list[dict[str, float]] = []
    done = 0
    if (found := checkpoints.load()) is not None:
        done, arrays, state = found
        run.restore(arrays, state["best_iteration"], state["best_loss"])
        rows = state["rows"]
    with track(f"train {name}", cell.iterations, done) as tracker:
        while done < cell.iterations:
            stop = min(done - done % training.validation_every + training.validation_every, cell.iterations)
            loss = float(np.mean([run.step(iteration) for iteration in range(done, stop)]))
            validation_loss, error = run.validate(stop)
            if not (math.isfinite(loss) and math.isfinite(validation_loss)):
                raise AnyviewError(
                    f"cell {name}: the loss diverged between iterations {done} and {stop}; lower "
                    "training.learning_rate"
                )
            measures = {"loss": loss, "validation_loss": validation_loss, "validation_time_error": error}
            rows.append({"iteration": stop} | measures)
            tracker.advance(stop - done, f"loss {loss:.3f}, validation {validation_loss:.3f}")
            done = stop
            if checkpoints.due() and done < cell.iterations:
                state = {"rows": rows, "best_iteration": run.best_iteration, "best_loss": run.best_loss}
                checkpoints.save(done, run.arrays(), state)
    with whole_folder(output) as folder:
        meta = {
            "cell": name,
            "dataset": cell.dataset,
            "method": "time-contrastive",
            "iterations": cell.iterations,
            "best_iteration": run.best_iteration,
        }
        save_embedding(folder, run.best_model(), meta)
        table = pd.DataFrame(rows)
        write_atomically(folder / "curve.csv", table.to_csv(index=False, float_format="%.6g"))
    checkpoints.clear()


def _key(name: str, cell: EmbeddingCell, training: Training, seed: int) -> str:
    folder, split = paths.clip_set(cell.dataset), paths.split_table(cell.dataset)
    values = [name, cell.model_dump(), training.model_dump(), seed]
    return content_key(values, [folder / "manifest.csv", folder / "files.csv", split])


def save_embedding(folder: Path, model: Embedding, meta: dict[str, Any]) -> None:
    """Write the weights, and ``model.json``: image size, dimensions and ``meta`` (JSON-serialisable)."""
    state = {name: value.detach().cpu() for name, value in model.state_dict().items()}
    write_atomically(folder / _WEIGHTS, save(state))
    described = {"image_size": model.image_size, "dimensions": model.dimensions, **meta}
    write_atomically(folder / _MODEL, json.dumps(described, indent=2, sort_keys=True) + "\n")


def load_embedding(folder: Path) -> Embedding:
    """The saved embedding, float32 on the CPU, in evaluation mode; AnyviewError where it is not one."""
    meta = _read_meta(folder / _MODEL)
    model = Embedding(meta["image_size"], meta["dimensions"])
    path = folder / _WEIGHTS
    try:
        model.load_state_dict(load(path.read_bytes()))
    except FileNotFoundError:
        raise AnyviewError(f"{path}: no such file; train the cell first") from None
    except SafetensorError as error:
        raise AnyviewError(f"{path}: not a safetensors file: {error}") from None
    except RuntimeError:
        raise AnyviewError(f"{path}: does not hold the weights that {_MODEL} beside it describes") from None
    return model.eval().requires_grad_(False)


def _read_meta(path: Path) -> dict[str, Any]:
    try:
        meta = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise AnyviewError(f"{path}: no such file; train the cell first") from None
    except (ValueError, RecursionError) as error:
        raise AnyviewError(f"{path}: not valid JSON: {error}") from None
    sizes = [meta.get(key) if isinstance(meta, dict) else None for key in ("image_size", "dimensions")]
    if not all(isinstance(size, int) and 0 < size <= _LARGEST for size in sizes):
        raise AnyviewError(
            f"{path}: no embedding: image_size and dimensions must be whole numbers from 1 to {_LARGEST}"
        )
    return meta
