"""Training: it learns, it resumes bit for bit, it stops when it diverges."""

import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch

from anyview.runtime.checkpoints import Checkpoints
from anyview.runtime.errors import AnyviewError
from anyview.training.sampling import validation_pairs
from anyview.training.trainer import Trainer
from anyview.training.training import LIVE_CURVES, train_translator
from anyview.translator.network import to_input
from anyview.translator.weights import load_translator, read_meta


def parameters(trainer: Trainer) -> torch.Tensor:
    return torch.cat([p.detach().flatten() for p in trainer.model.parameters()])


def test_it_learns_to_move_the_disc_in_a_context_of_its_own(pipeline, recipe, discs):
    """On held-out clips the translation is much better than the mean frame, and than showing the context."""
    made = recipe(iterations=120, batch_size=20, learning_rate=0.002, schedule="cosine", validation_every=40)
    train_translator(made, Path("data/models/sim"))
    model = load_translator(Path("data/models/sim"))
    pairs = validation_pairs(discs, np.random.default_rng(0), 64)
    paired, context = map(to_input, pairs.frames(discs))
    expert, target = paired.chunk(2)
    with torch.no_grad():
        z2, skips = model.encode_context(context)
        translated = model.decode(model.translate(model.encode_expert(expert), z2), skips)
    error = (translated - target).square().mean()
    assert error < 0.75 * (context - target).square().mean()
    assert error < 0.75 * target.var(dim=0).mean()
    curve = pd.read_csv("data/models/sim/curve.csv")
    assert list(curve["iteration"]) == [40, 80, 120]
    assert curve["validation_loss"].iloc[-1] == pytest.approx(curve["validation_loss"].min())
    parts = curve[["translation", "reconstruction", "alignment"]].sum(axis=1)
    assert np.allclose(parts, curve["loss"], rtol=1e-4)
    assert not list(LIVE_CURVES.glob("*"))


@pytest.mark.parametrize(
    "changes",
    [
        {"optimizer": "adam", "architecture": "compact"},
        {"optimizer": "adadelta", "architecture": "real"},
        {"optimizer": "adam", "architecture": "real", "augment": True, "schedule": "cosine"},
    ],
    ids=str,
)
def test_resumed_training_is_bit_identical(discs, recipe, tmp_path, changes):
    made = recipe(**changes)
    whole = Trainer(made, discs)
    losses = [whole.step(n) for n in range(3)]
    whole.validate(3)
    checkpoints = Checkpoints(tmp_path)
    checkpoints.save(3, whole.arrays(), {"iteration": whole.best_iteration, "loss": whole.best_loss})
    losses += [whole.step(n) for n in range(3, 6)]

    resumed = Trainer(made, discs)
    step, arrays, state = checkpoints.load()
    resumed.restore(arrays, state["iteration"], state["loss"])
    again = [resumed.step(n) for n in range(step, 6)]
    assert torch.equal(torch.stack(again), torch.stack(losses[3:]))
    assert torch.equal(parameters(resumed), parameters(whole))
    assert torch.equal(resumed.validate(6), whole.validate(6))
    assert resumed.best.keys() == whole.best.keys()
    assert all(torch.equal(resumed.best[name], whole.best[name]) for name in whole.best)


def test_killed_training_continues_to_the_same_bytes(pipeline, recipe):
    """SIGKILL in mid-training, then the same command again, against a run that was left alone."""
    made = recipe(iterations=30)
    train_translator(made, Path("alone"))
    program = (
        "import sys; from pathlib import Path; from anyview.training.training import train_translator;"
        "from anyview.training.trainer import Recipe; from anyview.config import TranslatorCell, Training;"
        "a = sys.argv; cell = TranslatorCell.model_validate_json(a[1]);"
        "recipe = Recipe('sim', cell, Training.model_validate_json(a[2]), 1);"
        "train_translator(recipe, Path('killed'))"
    )
    command = [sys.executable, "-c", program, made.cell.model_dump_json(), made.training.model_dump_json()]
    often = os.environ | {"ANYVIEW_CHECKPOINT_SECONDS": "0"}
    process = subprocess.Popen(command, env=often, stdout=subprocess.DEVNULL)
    curve = LIVE_CURVES / "sim.csv"
    deadline = time.monotonic() + 60
    while not (curve.exists() and len(pd.read_csv(curve)) >= 3):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert not Path("killed").exists()
    assert list(Path(os.environ["ANYVIEW_SCRATCH"]).rglob("checkpoint-*"))
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    for name in ("weights.safetensors", "model.json", "curve.csv"):
        assert (Path("killed") / name).read_bytes() == (Path("alone") / name).read_bytes(), name
    assert not list(Path(os.environ["ANYVIEW_SCRATCH"]).rglob("checkpoint-*"))


def test_diverging_training_stops_and_keeps_the_last_good_weights(pipeline, recipe):
    before = train_and_fail(recipe(iterations=300, learning_rate=30.0))
    assert "cell sim" in before
    assert "learning_rate" in before
    if "are in " in before:
        kept = Path(before.split("are in ")[1])
        assert torch.isfinite(torch.cat([p.flatten() for p in load_translator(kept).parameters()])).all()
        assert 0 < read_meta(kept)["best_iteration"] < 300
    assert not Path("model").exists()


def train_and_fail(made) -> str:
    with pytest.raises(AnyviewError) as caught:
        train_translator(made, Path("model"))
    return str(caught.value)


def test_best_weights_are_kept_by_the_losses_that_are_on(discs, recipe):
    """Without L_tr the best iteration is that of least L_rec + L_align."""
    trainer = Trainer(recipe(weights={"translation": 0.0}), discs)
    seen = []
    for iteration in range(8):
        losses = trainer.step(iteration)
        assert math.isnan(losses[1])
        seen.append(trainer.validate(iteration + 1))
    for row in seen:
        assert row[0].item() == pytest.approx((row[2] + row[3]).item())
    assert trainer.best_iteration == 1 + int(torch.stack(seen)[:, 0].argmin())


def test_cells_start_from_the_same_weights_and_see_the_same_batches(discs, recipe):
    """Ablations differ in their losses alone."""
    full, ablated = Trainer(recipe(), discs), Trainer(recipe(weights={"alignment": 0.0}), discs)
    assert torch.equal(parameters(full), parameters(ablated))
    assert torch.equal(full.step(0)[1:3], ablated.step(0)[1:3])


def test_parts_of_a_batch_add_up_to_its_gradient(discs, recipe):
    """One plain update of the whole batch gives the same weights, up to rounding."""
    made = recipe(precision="float32", optimizer="adadelta")
    trainer, plain = Trainer(made, discs), Trainer(made, discs)
    plain._parts = 1
    torch.testing.assert_close(trainer.step(0), plain.step(0), rtol=1e-4, atol=0)
    torch.testing.assert_close(parameters(trainer), parameters(plain), rtol=1e-3, atol=1e-5)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")
@pytest.mark.parametrize("architecture", ["real", "compact"])
def test_cuda_trains_as_the_processor_does(discs, recipe, monkeypatch, architecture):
    losses = {}
    for device in ("cpu", "cuda"):
        monkeypatch.setenv("ANYVIEW_DEVICE", device)
        trainer = Trainer(recipe(architecture=architecture, batch_size=40), discs)
        losses[device] = torch.stack([trainer.step(n).cpu() for n in range(20)])[-5:].mean(0)
        assert torch.isfinite(trainer.validate(20)).all()
    torch.testing.assert_close(losses["cuda"], losses["cpu"], rtol=0.1, atol=0)
