"""Which frames are paired with which."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from anyview.runtime.errors import AnyviewError
from anyview.training.sampling import (
    Dataset,
    FramePairs,
    clip_pairs,
    open_dataset,
    training_pairs,
    validation_pairs,
)
from tests.training.discworld import clip_table, disc_clips


def test_training_pairs_are_two_training_clips_at_one_time(discs):
    pairs = training_pairs(discs, np.random.default_rng(0), 5000)
    paired, context = pairs.frames(discs)
    expert, target = np.split(paired, 2)
    assert (pairs.sources != pairs.targets).all()
    training = set(discs.split("train"))
    assert set(pairs.sources) | set(pairs.targets) == training
    assert set(pairs.times) == set(range(discs.length))
    for n in range(0, 5000, 500):
        assert np.array_equal(expert[n], discs.frames[pairs.sources[n], pairs.times[n]])
        assert np.array_equal(context[n], discs.frames[pairs.targets[n], 0])
        assert np.array_equal(target[n], discs.frames[pairs.targets[n], pairs.times[n]])


@given(length=st.integers(1, 60), count=st.integers(1, 9))
def test_parts_keep_every_pair_once_and_in_order(length, count):
    numbers = np.arange(length)
    parts = FramePairs(numbers, numbers + 1, numbers + 2).parts(count)
    assert len(parts) == min(count, length)
    assert np.array_equal(np.concatenate([part.sources for part in parts]), numbers)
    assert np.array_equal(np.concatenate([part.times for part in parts]), numbers + 2)
    sizes = [len(part) for part in parts]
    assert max(sizes) - min(sizes) <= 1


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


def test_validation_frames_are_fixed_and_use_every_clip(discs):
    first, second = (validation_pairs(discs, np.random.default_rng(5), 20) for _ in range(2))
    assert np.array_equal(first.times, second.times)
    assert set(first.targets) == set(discs.split("validation"))


def test_dataset_joins_clips_with_their_split(pipeline, discs):
    dataset = open_dataset("diverse")
    assert np.array_equal(dataset.frames, discs.frames)
    assert np.array_equal(dataset.split("validation"), discs.split("validation"))


def test_split_that_does_not_fit_the_clips_is_refused(pipeline):
    path = pipeline / "data/splits/diverse.csv"
    table = pd.read_csv(path)
    table.loc[0, "clip"] = "stranger"
    table.to_csv(path, index=False)
    with pytest.raises(AnyviewError, match="stranger"):
        open_dataset("diverse")
    table.assign(clip=[f"clip-{n:03d}" for n in range(320)], split="train").to_csv(path, index=False)
    with pytest.raises(AnyviewError, match="validation"):
        open_dataset("diverse")
