"""The training loop of translators and embeddings: resumable, in parallel, watched while it runs."""

import math
import time
from collections.abc import Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from pathlib import Path
from typing import Any, Protocol, Self, TypeVar

import numpy as np
import pandas as pd
import torch
from torch import Tensor, nn

from anyview.config import CycleCell, EmbeddingCell, Training, TranslatorCell
from anyview.runtime.checkpoints import Checkpoints
from anyview.runtime.device import dtype_of_products, torch_device, use_threads
from anyview.runtime.errors import AnyviewError
from anyview.runtime.outputs import whole_folder, write_atomically
from anyview.runtime.progress import track
from anyview.runtime.scratch import checkpoint_folder
from anyview.training.common.optimization import MakeOptimizer, SharedOptimizer, learning_rate
from anyview.video.datasets import dataset_files

# The growing curve of a cell in training, for plots that follow it. It ends up in the cell's model folder.
LIVE_CURVES = Path("metrics/live")

# A batch is worked off in a fixed number of parts side by side, one thread each. So the bytes do not depend
# on the number of cores, and the threads wait for each other once an iteration, not once an operation.
_PARTS = 2
_DIVERGED = 10.0  # times the mean loss of the first interval

Row = dict[str, float]
State = dict[str, Tensor]


class Batch(Protocol):
    """What an update learns from."""

    def __len__(self) -> int:
        """How many pairs."""
        ...

    def parts(self, count: int) -> list[Self]:
        """The pairs in ``count`` runs of about equal length, fewer if there are fewer pairs."""
        ...


B = TypeVar("B", bound=Batch)


class Objective(Protocol[B]):
    """What a network is trained for. What is random in an iteration follows from its index alone."""

    @property
    def cell(self) -> TranslatorCell | EmbeddingCell | CycleCell:
        """Its data set, its iterations, and what else its kind has."""
        ...

    @property
    def dataset_names(self) -> Sequence[str]:
        """Of the sets of clips that the training reads."""
        ...

    @property
    def training(self) -> Training:
        """Batches, learning rate, validation."""
        ...

    @property
    def seed(self) -> int:
        """Root of the random streams."""
        ...

    @property
    def names(self) -> Sequence[str]:
        """Names of the entries of ``losses``; the first is ``loss``."""
        ...

    @property
    def optimizer(self) -> MakeOptimizer:
        """Makes the optimiser of some of the parameters; the loop sets its learning rate."""
        ...

    def network(self) -> Any:
        """A new network on the CPU, with the weights that every training of the seed starts from."""
        ...

    def batch(self, iteration: int) -> B:
        """The batch of an iteration."""
        ...

    def losses(self, model: Any, pairs: B, iteration: int, part: int) -> Tensor:
        """Means over ``pairs``, part number ``part`` of a batch: the loss to minimise, then others, (L,)."""
        ...

    def validation(self) -> list[B]:
        """The fixed pairs to validate on, in parts that fit into memory."""
        ...

    def validation_losses(self, model: Any, pairs: B) -> Tensor:
        """Means over ``pairs``, (V,)."""
        ...

    def validation_row(self, means: Tensor) -> Row:
        """A row of the curve from the means over all validation pairs, float64 (V,): ``loss`` and others."""
        ...

    def save(self, folder: Path, model: Any, meta: dict[str, Any]) -> None:
        """Write a model folder."""
        ...


def fit(name: str, objective: Objective[B], output: Path) -> None:
    """Train cell ``name`` into the model folder ``output``; continues an interrupted training bit for bit.

    The folder holds the weights of the least validation loss, their description, and ``curve.csv``. The curve
    has a row for each validation, with the mean training losses since the one before. While training runs it
    grows in ``LIVE_CURVES``.
    Raises AnyviewError if a loss is no longer finite or explodes. The best weights until then stay in the
    scratch folder.
    """
    cell, training, total = objective.cell, objective.training, objective.cell.iterations
    key = [name, cell.model_dump(), training.model_dump(), objective.seed]
    files = [path for dataset in objective.dataset_names for path in dataset_files(dataset)]
    checkpoints = Checkpoints(checkpoint_folder(key, files))
    live = LIVE_CURVES / f"{name}.csv"

    use_threads(1)
    device = torch_device()
    parts = _PARTS if device.type == "cpu" else 1
    model = objective.network().to(device)
    dtype = dtype_of_products(training.precision, device)
    optimizer = SharedOptimizer(model, objective.optimizer, parts, dtype)
    validation = objective.validation()
    done, best, rows = _resume(checkpoints, model, optimizer)
    start, began = done, time.monotonic()

    with ThreadPoolExecutor(parts) as pool, track(f"train {name}", total, done) as tracker:
        while done < total:
            stop = min(done - done % training.validation_every + training.validation_every, total)
            losses = [update(objective, optimizer, iteration, pool) for iteration in range(done, stop)]
            means = torch.stack(losses).double().mean(0)
            row = {"iteration": stop} | dict(zip(objective.names, means.tolist(), strict=True))
            found = objective.validation_row(validate(objective, model, validation, pool))
            row |= {f"validation_{loss}": value for loss, value in found.items()}
            if _diverged(row, rows):
                raise AnyviewError(_keep_last_good(name, objective, row, rows, best, checkpoints.folder))
            if all(row["validation_loss"] < earlier["validation_loss"] for earlier in rows):
                best = _weights(model)
            rows.append(row)
            _write_curve(live, rows)
            speed = (stop - start) * training.batch_size / (time.monotonic() - began)
            note = f"loss {row['loss']:.4g}, validation {row['validation_loss']:.4g}, {speed:.0f} samples/s"
            tracker.advance(stop - done, note)
            done = stop
            if checkpoints.due() and done < total:
                checkpoints.save(done, _arrays(model, optimizer, best), {"rows": rows})

    with whole_folder(output) as folder:
        _save(folder, name, objective, best, rows)
        _write_curve(folder / "curve.csv", rows)
    live.unlink(missing_ok=True)
    checkpoints.clear()


def update(objective: Objective[B], optimizer: SharedOptimizer, iteration: int, pool: Executor) -> Tensor:
    """One update of the optimiser's model by the iteration's batch; returns the batch's losses (L,)."""
    batch, model = objective.batch(iteration), optimizer.working
    parameters = list(model.parameters())

    def gradients(part: int, pairs: B) -> tuple[Tensor, tuple[Tensor | None, ...]]:
        """Losses and gradients of one part of the batch, weighted by its fraction of the batch."""
        losses = objective.losses(model, pairs, iteration, part) * (len(pairs) / len(batch))
        return losses.detach(), torch.autograd.grad(losses[0], parameters, allow_unused=True)

    found = list(pool.map(gradients, range(optimizer.count), batch.parts(optimizer.count)))
    rate = learning_rate(objective.training, iteration, objective.cell.iterations)
    optimizer.step(rate, [of_part for _, of_part in found], pool)
    return torch.stack([losses for losses, _ in found]).sum(0)


def validate(objective: Objective[B], model: nn.Module, parts: list[B], pool: Executor) -> Tensor:
    """Mean validation losses over all pairs of ``parts``, float64 (V,) on the CPU."""

    @torch.no_grad()  # the mode is each thread's own
    def sums(pairs: B) -> Tensor:
        return objective.validation_losses(model, pairs) * len(pairs)

    return torch.stack(list(pool.map(sums, parts))).sum(0).double().cpu() / sum(map(len, parts))


def _diverged(row: Row, rows: list[Row]) -> bool:
    """Whether the losses of the newest ``row``, after ``rows``, are not finite or explode."""
    limit = _DIVERGED * (rows or [row])[0]["loss"]
    return not all(math.isfinite(loss) and loss <= limit for loss in (row["loss"], row["validation_loss"]))


def _keep_last_good(
    name: str, objective: Objective[B], row: Row, rows: list[Row], best: State, scratch: Path
) -> str:
    """Save the best weights so far, if there are any; returns what to tell the user."""
    problem = (
        f"cell {name}: the loss diverged between iterations {rows[-1]['iteration'] if rows else 0} and "
        f"{row['iteration']} (training {row['loss']:.4g}, validation {row['validation_loss']:.4g}); "
        "lower training.learning_rate"
    )
    if not best:
        return problem
    kept = scratch / "last-good"
    _save(kept, name, objective, best, rows)
    return f"{problem}; the best weights until then, of iteration {_best_iteration(rows)}, are in {kept}"


def _save(folder: Path, name: str, objective: Objective[B], best: State, rows: list[Row]) -> None:
    """Write a model folder of the ``best`` weights."""
    cell = objective.cell
    meta = {"cell": name, "dataset": cell.dataset, "iterations": cell.iterations}
    model = objective.network()
    model.load_state_dict(best)
    objective.save(folder, model, meta | {"best_iteration": _best_iteration(rows)})


def _best_iteration(rows: list[Row]) -> float:
    return min(rows, key=lambda row: row["validation_loss"])["iteration"]


def _write_curve(path: Path, rows: list[Row]) -> None:
    """A CSV with a line for each row; a loss that the cell leaves out is an empty field."""
    write_atomically(path, pd.DataFrame(rows).to_csv(index=False, float_format="%.6g"))


def _weights(model: nn.Module) -> State:
    """A copy of the weights on the CPU."""
    return {name: value.detach().cpu().clone() for name, value in model.state_dict().items()}


def _arrays(model: nn.Module, optimizer: SharedOptimizer, best: State) -> dict[str, np.ndarray]:
    """What a checkpoint holds beside the curve: model, best weights and optimiser."""
    arrays = {f"model/{name}": value.numpy() for name, value in _weights(model).items()}
    arrays |= {f"best/{name}": value.numpy() for name, value in best.items()}
    return arrays | {f"optimizer/{name}": value for name, value in optimizer.arrays().items()}


def _resume(
    checkpoints: Checkpoints, model: nn.Module, optimizer: SharedOptimizer
) -> tuple[int, State, list[Row]]:
    """Iterations done, best weights and curve, from the newest checkpoint, whose state the others take on."""
    if (saved := checkpoints.load()) is None:
        return 0, {}, []
    done, arrays, state = saved
    groups: dict[str, dict[str, np.ndarray]] = {"model": {}, "best": {}, "optimizer": {}}
    for name, array in arrays.items():
        kind, rest = name.split("/", 1)
        groups[kind][rest] = array
    weights, best = (
        {name: torch.from_numpy(array) for name, array in groups[kind].items()} for kind in ("model", "best")
    )
    model.load_state_dict(weights)
    optimizer.restore(groups["optimizer"])
    return done, best, state["rows"]
