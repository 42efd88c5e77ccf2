"""Stage `train` for a translator cell: resumable, with a learning curve that can be watched."""

import math
import time
from pathlib import Path
from typing import Any

import pandas as pd
import torch
from torch import Tensor

from anyview import paths
from anyview.runtime.checkpoints import Checkpoints
from anyview.runtime.errors import AnyviewError
from anyview.runtime.outputs import whole_folder, write_atomically
from anyview.runtime.progress import track
from anyview.runtime.scratch import content_key, scratch_folder
from anyview.training.sampling import open_dataset
from anyview.training.trainer import Recipe, Trainer
from anyview.translator import losses
from anyview.translator.weights import save_translator

# The growing curve of a cell in training, for plots that follow it; it ends up in the cell's model folder.
LIVE_CURVES = Path("metrics/live")

_DIVERGED = 10.0  # times the mean loss of the first interval

Row = dict[str, float]


def train_translator(recipe: Recipe, output: Path) -> None:
    """Train a cell into the model folder ``output``; continues where an interrupted training stopped.

    The folder holds ``weights.safetensors`` and ``model.json`` of the best weights on the validation pairs
    (by the losses that the cell has on), and ``curve.csv``: a row for each validation, with the mean training
    losses since the one before. While training runs the curve grows in ``LIVE_CURVES``. Raises AnyviewError
    when the loss is no longer finite or explodes; the best weights until then stay in the scratch folder.
    """
    dataset = open_dataset(recipe.cell.dataset)
    scratch = scratch_folder("checkpoints", _key(recipe))
    checkpoints = Checkpoints(scratch)
    run = Trainer(recipe, dataset)
    rows: list[Row] = []
    start = 0
    if (found := checkpoints.load()) is not None:
        start, arrays, state = found
        run.restore(arrays, state["best_iteration"], state["best_loss"])
        rows = state["rows"]
    live = LIVE_CURVES / f"{recipe.name}.csv"
    total, every = recipe.cell.iterations, recipe.training.validation_every
    done, began = start, time.monotonic()
    with track(f"train {recipe.name}", total, start) as tracker:
        while done < total:
            stop = min(done - done % every + every, total)
            seen = torch.stack([run.step(iteration) for iteration in range(done, stop)]).double().mean(0)
            row = _row(stop, seen, run.validate(stop))
            _refuse_divergence(recipe, run, [*rows, row], scratch)
            rows.append(row)
            _write_curve(live, rows)
            speed = (stop - start) * recipe.training.batch_size / (time.monotonic() - began)
            note = f"loss {row['loss']:.0f}, validation {row['validation_loss']:.0f}, {speed:.0f} samples/s"
            tracker.advance(stop - done, note)
            done = stop
            if checkpoints.due() and done < total:
                state = {"rows": rows, "best_iteration": run.best_iteration, "best_loss": run.best_loss}
                checkpoints.save(done, run.arrays(), state)
    with whole_folder(output) as folder:
        save_translator(folder, run.best_model(), _meta(recipe, run))
        _write_curve(folder / "curve.csv", rows)
    live.unlink(missing_ok=True)
    checkpoints.clear()


def _row(iteration: int, training: Tensor, validation: Tensor) -> Row:
    names = ["loss", *losses.NAMES]
    row: Row = {"iteration": iteration}
    for prefix, values in (("", training), ("validation_", validation)):
        row |= {f"{prefix}{name}": value for name, value in zip(names, values.tolist(), strict=True)}
    return row


def _write_curve(path: Path, rows: list[Row]) -> None:
    """A CSV with a line for each row; a loss that the cell leaves out is an empty field."""
    write_atomically(path, pd.DataFrame(rows).to_csv(index=False, float_format="%.6g"))


def _refuse_divergence(recipe: Recipe, run: Trainer, rows: list[Row], scratch: Path) -> None:
    """Raise AnyviewError, with the best weights kept, when the newest losses are not finite or explode."""
    newest, limit = rows[-1], _DIVERGED * rows[0]["loss"]
    found = [newest["loss"], newest["validation_loss"]]
    if all(math.isfinite(loss) and loss <= limit for loss in found):
        return
    before = rows[-2]["iteration"] if len(rows) > 1 else 0
    problem = (
        f"cell {recipe.name}: the loss diverged between iterations {before} and {newest['iteration']} "
        f"(training {found[0]:.4g}, validation {found[1]:.4g}); lower training.learning_rate"
    )
    if run.best:
        kept = scratch / "last-good"
        save_translator(kept, run.best_model(), _meta(recipe, run))
        problem += f"; the best weights until then, of iteration {run.best_iteration}, are in {kept}"
    raise AnyviewError(problem)


def _meta(recipe: Recipe, run: Trainer) -> dict[str, Any]:
    return {
        "cell": recipe.name,
        "dataset": recipe.cell.dataset,
        "iterations": recipe.cell.iterations,
        "best_iteration": run.best_iteration,
    }


def _key(recipe: Recipe) -> str:
    dataset = recipe.cell.dataset
    folder, split = paths.clip_set(dataset), paths.split_table(dataset)
    values = [recipe.name, recipe.cell.model_dump(), recipe.training.model_dump(), recipe.seed]
    return content_key(values, [folder / "manifest.csv", folder / "files.csv", split])
