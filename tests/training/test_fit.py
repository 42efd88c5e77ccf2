"""The training loop: it learns, it resumes bit for bit, it stops when it diverges."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch

from anyview.config import Pretraining
from anyview.runtime.errors import AnyviewError
from anyview.training.common.batches import FramePairs, validation_pairs
from anyview.training.common.fit import LIVE_CURVES, fit, update, validate
from anyview.training.common.optimization import SharedOptimizer
from anyview.training.translator import TranslatorObjective
from anyview.translator.weights import load_translator, read_meta
from anyview.video.datasets import Dataset
from anyview.video.pixels import to_input
from tests.training.discworld import clip_table, disc_clips

UNEVEN = (slice(0, 1), slice(1, 3))  # parts of 4 and of 8 pairs
FILES = ("weights.safetensors", "model.json", "curve.csv")


def test_it_learns_to_move_the_disc_in_a_context_of_its_own(pipeline, make_objective, discs):
    """On held-out clips the translation is much better than the mean frame, and than showing the context."""
    changes = {"batch_size": 20, "learning_rate": 0.002, "schedule": "cosine", "validation_every": 40}
    fit("sim", make_objective(iterations=120, **changes), Path("data/models/sim"))
    model = load_translator(Path("data/models/sim"))
    pairs = validation_pairs(discs, np.random.default_rng(0), 64)
    expert, target = to_input(pairs.frames(discs)).chunk(2)
    context = to_input(pairs.contexts(discs))
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


class Interrupted(TranslatorObjective):
    """Ctrl-C in the fifth iteration."""

    def batch(self, iteration: int) -> FramePairs:
        if iteration == 4:
            raise KeyboardInterrupt
        return super().batch(iteration)


@pytest.mark.parametrize(
    "changes",
    [
        {"optimizer": "adam", "architecture": "compact"},
        {"optimizer": "adadelta", "architecture": "real"},
        {"optimizer": "adam", "architecture": "real", "augment": True, "schedule": "cosine"},
    ],
    ids=str,
)
def test_interrupted_training_continues_to_the_same_bytes(pipeline, make_objective, monkeypatch, changes):
    fit("sim", make_objective(**changes), Path("alone"))
    monkeypatch.setenv("ANYVIEW_CHECKPOINT_SECONDS", "0")
    with pytest.raises(KeyboardInterrupt):
        fit("sim", make_objective(Interrupted, **changes), Path("parts"))
    assert not Path("parts").exists()
    assert list(Path(os.environ["ANYVIEW_SCRATCH"]).rglob("checkpoint-*"))
    fit("sim", make_objective(**changes), Path("parts"))
    for name in FILES:
        assert (Path("parts") / name).read_bytes() == (Path("alone") / name).read_bytes(), name
    assert not list(Path(os.environ["ANYVIEW_SCRATCH"]).rglob("checkpoint-*"))


def test_killed_training_continues_to_the_same_bytes(pipeline, make_objective):
    """SIGKILL in mid-training, then the same command again, against a run that was left alone."""
    made = make_objective(iterations=30)
    fit("sim", made, Path("alone"))
    program = (
        "import sys; from pathlib import Path; from anyview.training.common.fit import fit;"
        "from anyview.training.translator import TranslatorObjective;"
        "from anyview.video.datasets import open_dataset;"
        "from anyview.config import TranslatorCell, Training;"
        "cell, training = TranslatorCell.model_validate_json(sys.argv[1]), sys.argv[2];"
        "training = Training.model_validate_json(training);"
        "fit('sim', TranslatorObjective(cell, training, 1, open_dataset(cell.dataset)), Path('killed'))"
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
    for name in FILES:
        assert (Path("killed") / name).read_bytes() == (Path("alone") / name).read_bytes(), name


@pytest.mark.parametrize("rehearsed", [False, True])
def test_pretraining_learns_from_the_other_set_first(make_objective, discs, rehearsed):
    """Until then as if on that set alone; after it, from the cell's own, by the same random streams.

    Or in turn from both, if the first is rehearsed.
    """
    other = Dataset("rendered", disc_clips(40, seed=9), clip_table(["train"] * 30 + ["validation"] * 10))
    made = make_objective()
    pretraining = Pretraining(dataset="rendered", iterations=3, rehearsed=rehearsed)
    cell = made.cell.model_copy(update={"pretraining": pretraining})
    both = TranslatorObjective(cell, made.training, 1, discs, other)
    alone = TranslatorObjective(made.cell, made.training, 1, other)
    model = made.network()
    for iteration in range(6):
        expected = alone if iteration < 3 or (rehearsed and iteration == 4) else made
        pairs = both.batch(iteration)
        losses = both.losses(model, pairs, iteration, 0)
        assert torch.equal(losses, expected.losses(model, expected.batch(iteration), iteration, 0))
    (part, *_), (same, *_) = both.validation(), made.validation()
    assert torch.equal(both.validation_losses(model, part), made.validation_losses(model, same))


def test_a_cell_may_have_a_learning_rate_and_schedule_of_its_own(make_objective):
    made = make_objective()
    assert (made.training.learning_rate, made.training.schedule) == (0.001, "constant")
    cell = made.cell.model_copy(update={"learning_rate": 0.004, "schedule": "cosine"})
    own = TranslatorObjective(cell, made.training, 1, made.dataset)
    assert (own.training.learning_rate, own.training.schedule) == (0.004, "cosine")


def test_places_that_nothing_teaches_are_refused(make_objective):
    made = make_objective(iterations=4)
    weights = made.cell.weights.model_copy(update={"places": 1.0})
    cell = made.cell.model_copy(update={"architecture": "keypoint", "weights": weights})
    with pytest.raises(AnyviewError, match=r"data set diverse: no marks"):
        TranslatorObjective(cell, made.training, 1, made.dataset)


def test_pretraining_on_frames_of_another_size_is_refused(make_objective, discs):
    made = make_objective()
    other = Dataset("rendered", disc_clips(4, size=32), clip_table(["train"] * 2 + ["validation"] * 2))
    cell = made.cell.model_copy(update={"pretraining": Pretraining(dataset="rendered", iterations=3)})
    with pytest.raises(AnyviewError, match="rendered and diverse: frames of 32 and 16 pixels"):
        TranslatorObjective(cell, made.training, 1, discs, other)


class Exploding(TranslatorObjective):
    """Losses a thousand times as large from the fifth iteration on."""

    def losses(self, model, pairs: FramePairs, iteration: int, part: int) -> torch.Tensor:
        return super().losses(model, pairs, iteration, part) * (1000.0 if iteration >= 4 else 1.0)


def test_diverging_training_stops_and_keeps_the_last_good_weights(pipeline, make_objective):
    with pytest.raises(AnyviewError, match=r"cell sim: .* diverged between iterations 3 and 6") as caught:
        fit("sim", make_objective(Exploding, iterations=300), Path("model"))
    assert "learning_rate" in str(caught.value)
    kept = Path(str(caught.value).split("of iteration 3, are in ")[1])
    assert read_meta(kept)["best_iteration"] == 3
    fit("sim", make_objective(iterations=3), Path("short"))
    assert torch.equal(parameters(load_translator(kept)), parameters(load_translator(Path("short"))))
    assert not Path("model").exists()


def test_training_whose_loss_is_not_a_number_stops(pipeline, make_objective):
    with pytest.raises(AnyviewError, match=r"cell sim: the loss diverged between iterations 0 and 3"):
        fit("sim", make_objective(iterations=300, learning_rate=1e30), Path("model"))
    assert not Path("model").exists()


def test_best_weights_are_kept_by_the_losses_that_are_on(pipeline, make_objective):
    """Without L_tr the best iteration is that of least L_rec + L_align, and L_tr is an empty field."""
    made = make_objective(weights={"translation": 0.0}, iterations=8, validation_every=1)
    fit("sim", made, Path("model"))
    curve = pd.read_csv("model/curve.csv")
    assert curve["translation"].isna().all()
    wanted = curve["validation_reconstruction"] + curve["validation_alignment"]
    assert np.allclose(curve["validation_loss"], wanted, rtol=1e-4)
    assert read_meta(Path("model"))["best_iteration"] == curve["iteration"][wanted.idxmin()]


def parameters(model: torch.nn.Module) -> torch.Tensor:
    return torch.cat([p.detach().flatten() for p in model.parameters()])


def test_cells_start_from_the_same_weights_and_see_the_same_batches(make_objective):
    """Ablations differ in their losses alone."""
    full, ablated = make_objective(), make_objective(weights={"alignment": 0.0})
    first, second = full.network(), ablated.network()
    assert torch.equal(parameters(first), parameters(second))
    losses = [made.losses(model, made.batch(0), 0, 0) for made, model in ((full, first), (ablated, second))]
    assert torch.equal(losses[0][1:3], losses[1][1:3])


def test_parts_of_a_batch_add_up_to_its_update(make_objective):
    """One part and two give the same losses and the same weights, up to rounding."""
    made = make_objective(precision="float32", optimizer="adadelta", batch_size=9)
    losses, weights = [], []
    for parts in (1, 2):
        model = made.network()
        optimizer = SharedOptimizer(model, made.optimizer, parts)
        with ThreadPoolExecutor(parts) as pool:
            losses.append(update(made, optimizer, 0, pool))
        weights.append(parameters(model))
    torch.testing.assert_close(*losses, rtol=1e-4, atol=0)
    torch.testing.assert_close(*weights, rtol=1e-3, atol=1e-5)


def test_validation_losses_are_means_over_all_pairs(make_objective):
    """In parts of different lengths as in one part."""
    made = make_objective(precision="float32", batch_size=5)
    model, parts = made.network(), made.validation()
    assert sorted(map(len, parts)) == [4, 4, 4]
    columns = [[getattr(part, name) for part in parts] for name in ("sources", "targets", "times")]
    whole = FramePairs(*map(np.concatenate, columns))
    uneven = [FramePairs(*(np.concatenate(column[rows]) for column in columns)) for rows in UNEVEN]
    with ThreadPoolExecutor(2) as pool:
        means = validate(made, model, uneven, pool)
    with torch.no_grad():
        expected = made.validation_losses(model, whole).double()
    torch.testing.assert_close(means, expected, rtol=1e-4, atol=0)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")
@pytest.mark.parametrize("architecture", ["real", "compact"])
def test_cuda_trains_as_the_processor_does(pipeline, make_objective, monkeypatch, architecture):
    losses = {}
    for device in ("cpu", "cuda"):
        monkeypatch.setenv("ANYVIEW_DEVICE", device)
        made = make_objective(architecture=architecture, batch_size=40, iterations=20, validation_every=5)
        fit(device, made, Path(device))
        losses[device] = pd.read_csv(Path(device) / "curve.csv")["loss"].iloc[-1]
    assert losses["cuda"] == pytest.approx(losses["cpu"], rel=0.1)
