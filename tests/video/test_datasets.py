"""Data sets with their splits, and which clips are paired to evaluate a translator."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from anyview.runtime.errors import AnyviewError
from anyview.video.datasets import Dataset, clip_pairs, open_dataset
from anyview.video.sets import write_clips, write_set
from tests.training.discworld import clip_table, disc_clips


@pytest.fixture
def views() -> Dataset:
    """Two views of each of three held-out demonstrations, a single, and two extreme clips."""
    splits = ["train", "train", *["validation"] * 7, "extreme", "extreme"]
    pairs = ["t", "t", "a", "b", "a", "b", "c", "c", "single", "e", "e"]
    table = clip_table(splits, pairs)
    table["kind"] = ["standard"] * 3 + ["distractor"] * 2 + ["standard"] * 4 + ["extreme_distractor"] * 2
    return Dataset("real", disc_clips(11), table)


def test_validation_pairs_the_two_views_of_a_demonstration(views):
    pairs = clip_pairs(views, "validation")
    assert [target for _, target in pairs] == list(range(2, 9))
    assert dict((target, source) for source, target in pairs) == {2: 4, 4: 2, 3: 5, 5: 3, 6: 7, 7: 6, 8: 2}


def test_extreme_clips_are_targets_of_standard_validation_clips(views):
    pairs = clip_pairs(views, "extreme")
    assert [target for _, target in pairs] == [9, 10]
    kinds = views.clips["kind"].iloc[[source for source, _ in pairs]]
    splits = views.clips["split"].iloc[[source for source, _ in pairs]]
    assert set(kinds) == {"standard"}
    assert set(splits) == {"validation"}


@pytest.fixture
def clips(tmp_path, monkeypatch) -> np.ndarray:
    """Six clips, in a folder in which the stages before have made data/clips/diverse and its split."""
    clips, table = disc_clips(6), clip_table(["train"] * 4 + ["validation"] * 2)
    folder = tmp_path / "data/clips/diverse"
    folder.mkdir(parents=True)
    write_set(folder, table[["clip"]], [write_clips(folder / "shard-0000.avi", clips, 10.0)])
    (tmp_path / "data/splits").mkdir()
    table.to_csv(tmp_path / "data/splits/diverse.csv", index=False)
    monkeypatch.chdir(tmp_path)
    return clips


def test_dataset_joins_clips_with_their_split(clips):
    dataset = open_dataset("diverse")
    assert np.array_equal(dataset.frames, clips)
    assert list(dataset.split("validation")) == [4, 5]
    assert list(dataset.split("extreme")) == []


@pytest.mark.usefixtures("clips")
def test_split_that_does_not_fit_the_clips_is_refused():
    path = Path("data/splits/diverse.csv")
    table = pd.read_csv(path)
    table.assign(clip=["stranger", *table["clip"][1:]]).to_csv(path, index=False)
    with pytest.raises(AnyviewError, match="stranger"):
        open_dataset("diverse")
    table.assign(split="train").to_csv(path, index=False)
    with pytest.raises(AnyviewError, match="validation"):
        open_dataset("diverse")
