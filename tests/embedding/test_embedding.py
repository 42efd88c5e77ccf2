"""The time-contrastive embedding: its loss by hand, what it learns, that it resumes, damage refused."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch

from anyview.config import EmbeddingCell, Training
from anyview.embedding.embedding import (
    Trainer,
    load_embedding,
    squared_distances,
    time_error,
    train_embedding,
    triplet_loss,
)
from anyview.runtime.checkpoints import Checkpoints
from anyview.runtime.errors import AnyviewError
from anyview.video.sets import write_clips, write_set
from tests.training.discworld import clip_table

CELL = EmbeddingCell(dataset="diverse", iterations=6, dimensions=8, margin=0.2)
TRAINING = Training(
    batch_size=40,
    learning_rate=0.001,
    schedule="cosine",
    precision="bfloat16",
    validation_every=3,
    validation_pairs=48,
)
OUTPUT = Path("data/models/tcn")


def unit_vectors(*shape: int, seed: int = 0) -> torch.Tensor:
    vectors = np.random.default_rng(seed).standard_normal(shape)
    return torch.from_numpy(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def test_triplet_loss_matches_a_literal_sum():
    one, other = unit_vectors(3, 5, 4, seed=1), unit_vectors(3, 5, 4, seed=2)
    terms = []
    for p in range(3):
        for t in range(5):
            near = ((one[p, t] - other[p, t]) ** 2).sum()
            far = [((one[p, t] - other[p, s]) ** 2).sum() for s in range(5) if s != t]
            terms += [max(0.0, (near - distance + 0.3).item()) for distance in far]
    assert triplet_loss(one, other, 0.3).item() == pytest.approx(np.mean(terms))
    expected = ((one[:, :, None] - other[:, None]) ** 2).sum(-1)
    torch.testing.assert_close(squared_distances(one, other), expected)


def test_time_error_is_zero_for_equal_clips_and_counts_frames_otherwise():
    clip = unit_vectors(2, 10, 16)
    assert time_error(clip, clip).item() == 0
    assert time_error(clip, clip.roll(1, dims=1)).item() == pytest.approx((9 * 1 + 9) / 10 / 10)


@pytest.fixture
def clocks(tmp_path, monkeypatch) -> None:
    """A working folder whose clips show a bar that grows with time, on grounds and at places of their own."""
    rng = np.random.default_rng(0)
    clips = np.empty((120, 12, 16, 16, 3), np.uint8)
    for clip in clips:
        clip[:] = rng.integers(0, 120, 3)
        left = rng.integers(0, 12)
        for t, frame in enumerate(clip):
            frame[15 - t :, left : left + 4] = rng.integers(200, 256)
    table = clip_table(["train"] * 100 + ["validation"] * 20)
    folder = tmp_path / "data/clips/diverse"
    folder.mkdir(parents=True)
    write_set(folder, table[["clip"]], [write_clips(folder / "shard-0000.avi", clips, 10.0)])
    (tmp_path / "data/splits").mkdir()
    table.to_csv(tmp_path / "data/splits/diverse.csv", index=False)
    monkeypatch.chdir(tmp_path)


@pytest.mark.usefixtures("clocks")
def test_it_learns_to_tell_the_time_across_views():
    cell = CELL.model_copy(update={"iterations": 150})
    train_embedding("tcn", cell, TRAINING.model_copy(update={"validation_every": 50}), 1, OUTPUT)
    curve = pd.read_csv(OUTPUT / "curve.csv")
    assert list(curve) == ["iteration", "loss", "validation_loss", "validation_time_error"]
    assert list(curve["iteration"]) == [50, 100, 150]
    best = curve.loc[curve["validation_loss"].idxmin()]
    assert best["validation_time_error"] < 0.1  # guessing gives 1/3
    meta = json.loads((OUTPUT / "model.json").read_text())
    assert meta["best_iteration"] == best["iteration"]
    model = load_embedding(OUTPUT)
    embedded = model(torch.zeros(2, 3, model.image_size, model.image_size))
    torch.testing.assert_close(embedded.norm(dim=-1), torch.ones(2))


def test_resumed_training_is_bit_identical(discs, tmp_path):
    straight, first = Trainer(CELL, TRAINING, 1, discs), Trainer(CELL, TRAINING, 1, discs)
    for iteration in range(3):
        straight.step(iteration), first.step(iteration)
    straight.validate(3), first.validate(3)
    checkpoints = Checkpoints(tmp_path)
    checkpoints.save(3, first.arrays(), {"iteration": first.best_iteration, "loss": first.best_loss})
    step, arrays, state = checkpoints.load()
    resumed = Trainer(CELL, TRAINING, 1, discs)
    resumed.restore(arrays, state["iteration"], state["loss"])
    for iteration in range(step, 6):
        assert straight.step(iteration) == resumed.step(iteration)
    assert straight.validate(6) == resumed.validate(6)
    for name, array in straight.arrays().items():
        np.testing.assert_array_equal(resumed.arrays()[name], array, err_msg=name)


@pytest.mark.usefixtures("pipeline")
def test_the_same_seed_gives_the_same_bytes():
    for output in (OUTPUT, OUTPUT.with_name("again")):
        train_embedding("tcn", CELL, TRAINING, 1, output)
    for name in ("weights.safetensors", "model.json", "curve.csv"):
        assert (OUTPUT / name).read_bytes() == (OUTPUT.with_name("again") / name).read_bytes()


@pytest.mark.usefixtures("pipeline")
def test_divergence_is_reported_and_leaves_no_output():
    training = TRAINING.model_copy(update={"learning_rate": 1e30})
    with pytest.raises(AnyviewError, match=r"cell tcn: the loss diverged.*learning_rate"):
        train_embedding("tcn", CELL, training, 1, OUTPUT)
    assert not OUTPUT.exists()


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda folder: (folder / "model.json").unlink(), "model.json: no such file"),
        (lambda folder: (folder / "model.json").write_text("{"), "not valid JSON"),
        (lambda folder: (folder / "model.json").write_text('{"image_size": 16}'), "no embedding"),
        (lambda folder: (folder / "weights.safetensors").unlink(), "weights.safetensors: no such file"),
        (lambda folder: (folder / "weights.safetensors").write_bytes(b"x"), "not a safetensors file"),
        (
            lambda folder: (folder / "model.json").write_text('{"image_size": 16, "dimensions": 9}'),
            "does not hold the weights",
        ),
    ],
    ids=["no description", "not JSON", "keys missing", "no weights", "not weights", "other weights"],
)
@pytest.mark.usefixtures("pipeline")
def test_a_damaged_model_is_refused_by_name(damage, message):
    train_embedding("tcn", CELL.model_copy(update={"iterations": 1}), TRAINING, 1, OUTPUT)
    damage(OUTPUT)
    with pytest.raises(AnyviewError, match=message):
        load_embedding(OUTPUT)
