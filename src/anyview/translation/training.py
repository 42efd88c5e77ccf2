"""Training of one translator cell: resumable, deterministic, with a learning curve that can be watched."""

import math
import time
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pandas as pd
import torch
from torch import Tensor

from anyview.config import Training, TranslatorCell
from anyview.runtime.checkpoints import Checkpoints
from anyview.runtime.device import torch_device, use_threads
from anyview.runtime.errors import AnyviewError
from anyview.runtime.outputs import whole_folder, write_atomically
from anyview.runtime.progress import track
from anyview.runtime.scratch import content_key, scratch_folder
from anyview.runtime.seeds import stream, torch_seed
from anyview.translation import augmentation, losses, network, sampling, weights
from anyview.translation.augmentation import Augmentation
from anyview.translation.losses import NAMES, Losses, batch_losses
from anyview.translation.network import ContextTranslator, to_input
from anyview.translation.sampling import (
    DATASETS,
    Dataset,
    FramePairs,
    open_dataset,
    training_pairs,
    validation_pairs,
)

# The growing curve of a cell that is being trained; moved into its model folder at the end.
LIVE_CURVES = Path("metrics/live")

_THREADS = 2  # fixed: sums are split by thread count, so another count would give other bytes
_DIVERGED = 10.0


@dataclass(frozen=True)
class Recipe:
    """Everything that decides the weights, but for the data."""

    name: str
    cell: TranslatorCell
    training: Training
    seed: int


class Trainer:
    """The state of a training: model, optimiser, best weights so far."""

    def __init__(self, recipe: Recipe, dataset: Dataset):
        self._recipe, self._dataset = recipe, dataset
        self._device = torch_device()
        with torch.random.fork_rng():
            torch.manual_seed(torch_seed(recipe.seed, "translator/weights"))
            model = ContextTranslator(recipe.cell.architecture, dataset.image_size)
        self.model = model.to(self._device).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._optimizer = _optimizer(recipe, self.model)
        rng = stream(recipe.seed, "translator/validation")
        self._validation = validation_pairs(dataset, rng, recipe.training.validation_pairs)
        self._augmentation = Augmentation(dataset) if recipe.cell.augment else None
        self.best: dict[str, Tensor] = {}
        self.best_iteration = 0
        self.best_loss = math.inf

    def step(self, iteration: int) -> Tensor:
        """One update; returns the total loss, L_tr, L_rec and L_align (NaN where left out), shape (4,).

        Every random number belongs to the iteration, so that a resumed training draws the same.
        """
        cell, training, seed = self._recipe.cell, self._recipe.training, self._recipe.seed
        pairs = training_pairs(
            self._dataset, stream(seed, "translator/pairs", iteration), training.batch_size
        )
        expert, context, target = self._input(pairs)
        if self._augmentation is not None:
            rng = stream(seed, "translator/augmentation", iteration)
            (expert,) = self._augmentation(expert[None], pairs.sources, rng)
            context, target = self._augmentation(torch.stack((context, target)), pairs.targets, rng)
        torch.manual_seed(torch_seed(seed, "translator/dropout", iteration))
        for group in self._optimizer.param_groups:
            group["lr"] = learning_rate(training, iteration, cell.iterations)
        self._optimizer.zero_grad(set_to_none=True)
        self.model.train()
        with self._autocast():
            found = batch_losses(self.model, expert, context, target, wanted=cell.weights)
        total = found.total(cell.weights)
        total.backward()
        self._optimizer.step()
        return torch.stack((total.detach(), *_parts(found)))

    @torch.no_grad()
    def validate(self, iteration: int) -> Tensor:
        """The same losses on the fixed validation pairs; keeps the weights if they are the best so far."""
        self.model.eval()
        size = self._recipe.training.batch_size
        count = len(self._validation.expert)
        sums = torch.zeros(len(NAMES), dtype=torch.float64)
        for start in range(0, count, size):
            expert, context, target = self._input(self._validation, slice(start, start + size))
            with self._autocast():
                found = batch_losses(self.model, expert, context, target)
            sums += torch.stack(_parts(found)).cpu() * len(expert)
        means = sums / count
        total = Losses(*means).total(self._recipe.cell.weights)
        if total < self.best_loss:
            self.best_loss, self.best_iteration = float(total), iteration
            self.best = {name: value.clone() for name, value in weights.stored_state(self.model).items()}
        return torch.stack((total, *means))

    def arrays(self) -> dict[str, np.ndarray]:
        """Model, optimiser and best weights, for a checkpoint."""
        arrays = {f"model/{name}": value.numpy() for name, value in weights.stored_state(self.model).items()}
        arrays |= {f"best/{name}": value.numpy() for name, value in self.best.items()}
        for index, state in self._optimizer.state_dict()["state"].items():
            arrays |= {f"optimizer/{index}/{key}": value.cpu().numpy() for key, value in state.items()}
        return arrays

    def restore(self, arrays: dict[str, np.ndarray], best_iteration: int, best_loss: float) -> None:
        """Continue from ``arrays()`` bit for bit."""
        groups: dict[str, dict[str, Tensor]] = {"model": {}, "best": {}, "optimizer": {}}
        for name, array in arrays.items():
            kind, rest = name.split("/", 1)
            groups[kind][rest] = torch.from_numpy(array)
        weights.restore_state(self.model, groups["model"])
        self.best, self.best_iteration, self.best_loss = groups["best"], best_iteration, best_loss
        state: dict[int, dict[str, Tensor]] = {}
        parameters = [p for group in self._optimizer.param_groups for p in group["params"]]
        for name, value in groups["optimizer"].items():
            index, key = name.split("/")
            like = parameters[int(index)]
            # The fused optimiser walks over memory: moments must be laid out as their parameters are.
            kept = torch.empty_like(like).copy_(value) if value.shape == like.shape else value
            state.setdefault(int(index), {})[key] = kept
        self._optimizer.load_state_dict(self._optimizer.state_dict() | {"state": state})

    def best_model(self) -> ContextTranslator:
        """A translator with the best weights."""
        model = ContextTranslator(self._recipe.cell.architecture, self._dataset.image_size)
        weights.restore_state(model, self.best)
        return model

    def _input(self, pairs: FramePairs, rows: slice = slice(None)) -> tuple[Tensor, Tensor, Tensor]:
        def convert(frames: np.ndarray) -> Tensor:
            return to_input(torch.from_numpy(frames[rows]).to(self._device))

        return convert(pairs.expert), convert(pairs.context), convert(pairs.target)

    def _autocast(self) -> torch.autocast:
        reduced = self._recipe.training.precision == "bfloat16"
        return torch.autocast(self._device.type, torch.bfloat16, enabled=reduced)


def learning_rate(training: Training, iteration: int, iterations: int) -> float:
    """The rate of an iteration: constant, or half a cosine from ``learning_rate`` down to 0."""
    if training.schedule == "constant":
        return training.learning_rate
    return training.learning_rate * (1 + math.cos(math.pi * iteration / iterations)) / 2


def train_translator(recipe: Recipe, output: Path) -> None:
    """Train a cell into the model folder ``output``; continues where an interrupted training stopped.

    The folder holds ``weights.safetensors`` and ``model.json`` of the best weights on the validation pairs
    (by the losses that the cell has on), and ``curve.csv``: a row for each validation, with the mean training
    losses since the one before. While training runs the curve grows in ``LIVE_CURVES``. Raises AnyviewError
    when the loss is no longer finite or explodes; the best weights until then stay in the scratch folder.
    """
    use_threads(_THREADS)
    dataset = open_dataset(recipe.cell.dataset)
    scratch = scratch_folder("checkpoints", _key(recipe))
    checkpoints = Checkpoints(scratch)
    trainer = Trainer(recipe, dataset)
    rows: list[dict[str, float | None]] = []
    start = 0
    if (found := checkpoints.load()) is not None:
        start, arrays, state = found
        trainer.restore(arrays, state["best_iteration"], state["best_loss"])
        rows = state["rows"]
    live = LIVE_CURVES / f"{recipe.name}.csv"
    total, every = recipe.cell.iterations, recipe.training.validation_every
    began = time.monotonic()
    with track(f"train {recipe.name}", total, start) as tracker:
        for done in _stops(start, total, every):
            first = rows[-1]["iteration"] if rows else 0
            losses_seen = torch.stack([trainer.step(iteration) for iteration in range(int(first or 0), done)])
            row = _row(done, losses_seen.double().mean(dim=0), trainer.validate(done))
            _refuse_divergence(recipe, trainer, rows, row, scratch)
            rows.append(row)
            _write_curve(live, rows)
            speed = (done - start) * recipe.training.batch_size / (time.monotonic() - began)
            note = f"loss {row['loss']:.0f}, validation {row['validation_loss']:.0f}, {speed:.0f} samples/s"
            tracker.advance(len(losses_seen), note)
            if checkpoints.due() and done < total:
                state = {
                    "rows": rows,
                    "best_iteration": trainer.best_iteration,
                    "best_loss": trainer.best_loss,
                }
                checkpoints.save(done, trainer.arrays(), state)
    with whole_folder(output) as folder:
        weights.save_translator(folder, trainer.best_model(), _meta(recipe, trainer))
        _write_curve(folder / "curve.csv", rows)
    live.unlink()
    checkpoints.clear()


def _optimizer(recipe: Recipe, model: ContextTranslator) -> torch.optim.Optimizer:
    rate = recipe.training.learning_rate
    if recipe.cell.optimizer == "adam":
        return torch.optim.Adam(model.parameters(), lr=rate, fused=True)
    return torch.optim.Adadelta(model.parameters(), lr=rate, foreach=True)


def _parts(found: Losses) -> list[Tensor]:
    present = [getattr(found, name) for name in NAMES]
    like = next(loss for loss in present if loss is not None)
    return [torch.full_like(like, math.nan) if loss is None else loss.detach() for loss in present]


def _stops(start: int, total: int, every: int) -> list[int]:
    """Iterations after which to validate: every ``every``, and the last."""
    return [
        *(stop for stop in range(every, total, every) if stop > start),
        *([total] if start < total else []),
    ]


def _row(iteration: int, training: Tensor, validation: Tensor) -> dict[str, float | None]:
    names = ["loss", *NAMES]
    values = dict(zip(names, training.tolist(), strict=True))
    values |= zip((f"validation_{name}" for name in names), validation.tolist(), strict=True)
    return {"iteration": iteration} | {
        key: None if math.isnan(value) else value for key, value in values.items()
    }


def _write_curve(path: Path, rows: list[dict[str, float | None]]) -> None:
    write_atomically(path, pd.DataFrame(rows).to_csv(index=False, float_format="%.6g"))


def _refuse_divergence(
    recipe: Recipe,
    trainer: Trainer,
    rows: list[dict[str, float | None]],
    row: dict[str, float | None],
    scratch: Path,
) -> None:
    """Raise AnyviewError, with the best weights kept, when the newest losses are not finite or explode."""
    newest = [row["loss"], row["validation_loss"]]
    limit = _DIVERGED * float(rows[0]["loss"] or 0.0) if rows else math.inf
    if all(loss is not None and math.isfinite(loss) and loss <= limit for loss in newest):
        return
    before = rows[-1]["iteration"] if rows else 0
    problem = (
        f"cell {recipe.name}: the loss diverged between iterations {before} and {row['iteration']} "
        f"(training {newest[0]}, validation {newest[1]}); lower translation.training.learning_rate"
    )
    if trainer.best:
        kept = scratch / "last-good"
        weights.save_translator(kept, trainer.best_model(), _meta(recipe, trainer))
        problem += f"; the best weights until then, of iteration {trainer.best_iteration}, are in {kept}"
    raise AnyviewError(problem)


def _meta(recipe: Recipe, trainer: Trainer) -> dict[str, Any]:
    return {
        "cell": recipe.name,
        "dataset": recipe.cell.dataset,
        "iterations": recipe.cell.iterations,
        "best_iteration": trainer.best_iteration,
    }


def _key(recipe: Recipe) -> str:
    folder, split = DATASETS[recipe.cell.dataset]
    code: list[ModuleType] = [network, weights, losses, sampling, augmentation]
    files = [Path(__file__), *(Path(str(module.__file__)) for module in code)]
    values = [recipe.name, recipe.cell.model_dump(), recipe.training.model_dump(), recipe.seed]
    return content_key(values, [*files, folder / "manifest.csv", folder / "files.csv", split])
