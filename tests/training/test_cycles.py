"""The training of XIRL's embedding: what it is shown, what it learns, that it resumes."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from anyview.config import CycleCell, Training
from anyview.embedding.weights import load_embedding
from anyview.training.common.fit import fit
from anyview.training.cycles import ClipFrames, CycleObjective
from anyview.video.datasets import Dataset, open_dataset
from anyview.video.sets import write_clips, write_set
from tests.training.discworld import clip_table

CELL = CycleCell(
    dataset="diverse", experts="real", iterations=6, dimensions=8, clips=8, frames=6, temperature=0.1
)
TRAINING = Training(
    batch_size=40,
    learning_rate=0.003,
    schedule="cosine",
    precision="float32",
    validation_every=3,
    validation_pairs=200,
)


def clocks(folder: Path, name: str, length: int, vertical: bool) -> None:
    """Clips of a bar that grows with time, upwards or sideways, on grounds and at places of their own."""
    rng = np.random.default_rng(length)
    clips = np.empty((60, length, 16, 16, 3), np.uint8)
    for clip in clips:
        clip[:] = rng.integers(0, 60, 3)
        place = rng.integers(0, 12)
        for t, frame in enumerate(clip):
            canvas = frame if vertical else frame.swapaxes(0, 1)
            canvas[15 - 15 * t // (length - 1) :, place : place + 4] = rng.integers(200, 256)
    table = clip_table(["train"] * 50 + ["validation"] * 10)
    table["clip"] = name + table["clip"]
    (folder / "data/clips" / name).mkdir(parents=True)
    stored = write_clips(folder / "data/clips" / name / "shard-0000.avi", clips, 10.0)
    write_set(folder / "data/clips" / name, table[["clip"]], [stored])
    (folder / "data/splits").mkdir(exist_ok=True)
    table.to_csv(folder / f"data/splits/{name}.csv", index=False)


@pytest.fixture
def dataset(tmp_path, monkeypatch) -> Dataset:
    """The arm's clips, of 50 frames, and a hand's of 80."""
    clocks(tmp_path, "diverse", 50, vertical=True)
    clocks(tmp_path, "real", 80, vertical=False)
    monkeypatch.chdir(tmp_path)
    return open_dataset("diverse", "real")


def test_a_batch_is_of_training_clips_of_both_bodies_spread_over_each(dataset):
    objective = CycleObjective(CELL, TRAINING, 1, dataset)
    clips = objective.batch(0)
    frames, times = clips.frames(dataset), clips.times(dataset)
    assert frames.shape == (8, 6, 16, 16, 3)
    assert set(clips.experts) <= set(dataset.experts.split("train"))
    assert set(clips.own) <= set(dataset.split("train"))
    assert np.array_equal(frames[1, 2], dataset.experts.frames[clips.experts[1], clips.expert_times[1, 2]])
    assert np.array_equal(frames[5, 4], dataset.frames[clips.own[1], clips.own_times[1, 4]])
    assert (np.ceil(times * 6 - 6 / 50) <= np.arange(6) + 1).all()  # one frame in each sixth of every clip
    assert (np.floor(times * 6 + 6 / 50) >= np.arange(6)).all()
    assert [len(part) for part in clips.parts(2)] == [2, 2]
    np.testing.assert_array_equal(np.concatenate([part.own for part in clips.parts(2)]), clips.own)


def test_hand_and_arm_come_to_lie_together_though_nobody_pairs_them(dataset):
    cell = CELL.model_copy(update={"iterations": 200})
    training = TRAINING.model_copy(update={"validation_every": 50})
    fit("xirl", CycleObjective(cell, training, 1, dataset), Path("data/models/xirl"))
    curve = pd.read_csv("data/models/xirl/curve.csv")
    assert list(curve) == ["iteration", "loss", "validation_loss", "validation_time_error"]
    best = curve.loc[curve["validation_loss"].idxmin()]
    assert best["validation_time_error"] < 0.2  # guessing gives 1/3
    assert load_embedding(Path("data/models/xirl")).dimensions == 8


class Interrupted(CycleObjective):
    """Ctrl-C in the fifth iteration."""

    def batch(self, iteration: int) -> ClipFrames:
        if iteration == 4:
            raise KeyboardInterrupt
        return super().batch(iteration)


def test_interrupted_training_continues_to_the_same_bytes(dataset, monkeypatch):
    fit("xirl", CycleObjective(CELL, TRAINING, 1, dataset), Path("alone"))
    monkeypatch.setenv("ANYVIEW_CHECKPOINT_SECONDS", "0")
    with pytest.raises(KeyboardInterrupt):
        fit("xirl", Interrupted(CELL, TRAINING, 1, dataset), Path("parts"))
    fit("xirl", CycleObjective(CELL, TRAINING, 1, dataset), Path("parts"))
    for name in ("weights.safetensors", "model.json", "curve.csv"):
        assert (Path("parts") / name).read_bytes() == (Path("alone") / name).read_bytes(), name
