"""The training of the embedding: what it learns, that it resumes, that it stops when it diverges."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from anyview.config import EmbeddingCell, Training
from anyview.embedding.weights import load_embedding
from anyview.runtime.errors import AnyviewError
from anyview.training.common.batches import FramePairs
from anyview.training.common.fit import fit
from anyview.training.embedding import EmbeddingObjective
from anyview.video.datasets import open_dataset
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
    training = TRAINING.model_copy(update={"validation_every": 50})
    fit("tcn", EmbeddingObjective(cell, training, 1, open_dataset("diverse")), OUTPUT)
    curve = pd.read_csv(OUTPUT / "curve.csv")
    assert list(curve) == ["iteration", "loss", "validation_loss", "validation_time_error"]
    assert list(curve["iteration"]) == [50, 100, 150]
    best = curve.loc[curve["validation_loss"].idxmin()]
    assert best["validation_time_error"] < 0.1  # guessing gives 1/3
    meta = json.loads((OUTPUT / "model.json").read_text())
    assert meta["best_iteration"] == best["iteration"]
    assert load_embedding(OUTPUT).dimensions == 8


class Interrupted(EmbeddingObjective):
    """Ctrl-C in the fifth iteration."""

    def batch(self, iteration: int) -> FramePairs:
        if iteration == 4:
            raise KeyboardInterrupt
        return super().batch(iteration)


@pytest.mark.usefixtures("pipeline")
def test_interrupted_training_continues_to_the_same_bytes(discs, monkeypatch):
    fit("tcn", EmbeddingObjective(CELL, TRAINING, 1, discs), Path("alone"))
    monkeypatch.setenv("ANYVIEW_CHECKPOINT_SECONDS", "0")
    with pytest.raises(KeyboardInterrupt):
        fit("tcn", Interrupted(CELL, TRAINING, 1, discs), Path("parts"))
    fit("tcn", EmbeddingObjective(CELL, TRAINING, 1, discs), Path("parts"))
    for name in ("weights.safetensors", "model.json", "curve.csv"):
        assert (Path("parts") / name).read_bytes() == (Path("alone") / name).read_bytes(), name


@pytest.mark.usefixtures("pipeline")
def test_divergence_is_reported_and_leaves_no_output(discs):
    training = TRAINING.model_copy(update={"learning_rate": 1e30})
    with pytest.raises(AnyviewError, match=r"cell tcn: the loss diverged.*learning_rate"):
        fit("tcn", EmbeddingObjective(CELL, training, 1, discs), OUTPUT)
    assert not OUTPUT.exists()
