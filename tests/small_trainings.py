"""A small dataset of moving discs, and small recipes."""

from collections.abc import Callable
from pathlib import Path

import pytest

from anyview.config import LossWeights, Training, TranslatorCell
from anyview.training.sampling import Dataset
from anyview.training.trainer import Recipe
from anyview.video.sets import write_clips, write_set
from tests.training.discworld import clip_table, disc_clips


@pytest.fixture(scope="session")
def discs() -> Dataset:
    """300 clips to train on and 20 held out."""
    return Dataset("diverse", disc_clips(320), clip_table(["train"] * 300 + ["validation"] * 20))


@pytest.fixture
def recipe() -> Callable[..., Recipe]:
    """Make a small recipe; keyword arguments change the cell, or the training shared by cells."""

    def make(**changes: object) -> Recipe:
        weights = {"translation": 1.0, "reconstruction": 1.0, "alignment": 1.0}
        training = {
            "batch_size": 10,
            "learning_rate": 0.001,
            "schedule": "constant",
            "precision": "bfloat16",
            "validation_every": 3,
            "validation_pairs": 12,
        }
        cell = {
            "dataset": "diverse",
            "architecture": "compact",
            "optimizer": "adam",
            "iterations": 6,
            "weights": LossWeights(**weights | changes.pop("weights", {})),
            "augment": False,
        }
        shared = {name: changes.pop(name) for name in list(changes) if name in training}
        return Recipe("sim", TranslatorCell(**cell | changes), Training(**training | shared), seed=1)

    return make


@pytest.fixture
def pipeline(tmp_path, monkeypatch, discs) -> Path:
    """A working folder in which the stages before have made data/clips/diverse and its split."""
    folder = tmp_path / "data/clips/diverse"
    folder.mkdir(parents=True)
    stored = [write_clips(folder / "shard-0000.avi", discs.frames, 10.0)]
    write_set(folder, discs.clips[["clip"]], stored)
    (tmp_path / "data/splits").mkdir()
    discs.clips.to_csv(tmp_path / "data/splits/diverse.csv", index=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path
