"""A small dataset of moving discs, and what small translators are trained for on it."""

from collections.abc import Callable
from pathlib import Path

import pytest

from anyview.config import LossWeights, Pretraining, Training, TranslatorCell
from anyview.training.translator import TranslatorObjective
from anyview.video.datasets import Dataset
from anyview.video.sets import write_clips, write_set
from tests.training.discworld import clip_table, disc_clips


@pytest.fixture(scope="session")
def discs() -> Dataset:
    """300 clips to train on and 20 held out."""
    return Dataset("diverse", disc_clips(320), clip_table(["train"] * 300 + ["validation"] * 20))


@pytest.fixture
def make_objective(discs) -> Callable[..., TranslatorObjective]:
    """Make the objective of a small translator; keyword arguments change the cell, or the shared training."""

    def make(kind: type[TranslatorObjective] = TranslatorObjective, **changes: object) -> TranslatorObjective:
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
            "pretraining": Pretraining(dataset="diverse", iterations=0),
            "augment": False,
        }
        shared = {name: changes.pop(name) for name in list(changes) if name in training}
        return kind(TranslatorCell(**cell | changes), Training(**training | shared), 1, discs)

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
