"""Which frames are paired with which."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from anyview.runtime.errors import AnyviewError
from anyview.training.common.batches import (
    FramePairs,
    training_pairs,
    training_triplets,
    training_views,
    validation_pairs,
    validation_triplets,
)
from anyview.video.datasets import Dataset
from tests.training.discworld import LENGTH, SIZE, clip_table, disc_clips, disc_marks


def test_training_pairs_are_two_training_clips_at_one_time(discs):
    pairs = training_pairs(discs, np.random.default_rng(0), 5000)
    expert, target = np.split(pairs.frames(discs), 2)
    context = pairs.contexts(discs)
    assert (pairs.sources != pairs.targets).all()
    training = set(discs.split("train"))
    assert set(pairs.sources) | set(pairs.targets) == training
    assert set(pairs.times) == set(range(discs.length))
    for n in range(0, 5000, 500):
        assert np.array_equal(expert[n], discs.frames[pairs.sources[n], pairs.times[n]])
        assert np.array_equal(context[n], discs.frames[pairs.targets[n], 0])
        assert np.array_equal(target[n], discs.frames[pairs.targets[n], pairs.times[n]])


def test_training_pairs_share_the_choice_where_there_is_one(discs):
    clips = discs.clips.assign(choice=np.resize(["red", "green", "green"], len(discs.clips)))
    chosen = Dataset("choice", discs.frames, clips)
    pairs = training_pairs(chosen, np.random.default_rng(0), 5000)
    choices = clips["choice"].to_numpy()
    assert (choices[pairs.sources] == choices[pairs.targets]).all()
    assert (pairs.sources != pairs.targets).all()
    for side in (pairs.sources, pairs.targets):  # each clip as often as any other
        counts = np.bincount(side, minlength=len(clips))[chosen.split("train")]
        assert abs(counts - counts.mean()).max() < 6 * np.sqrt(counts.mean())
    held_out = validation_pairs(chosen, np.random.default_rng(0), 20)
    assert (choices[held_out.sources] == choices[held_out.targets]).all()
    assert set(held_out.targets) == set(chosen.split("validation"))


def test_the_frames_to_embed_are_those_of_the_clips_i(discs):
    pairs = FramePairs(np.array([3, 1]), np.array([0, 2]), np.array([5, 6]))
    frames = pairs.clips(discs, np.array([0, 4, 11]))
    assert frames.shape == (2, 3, 16, 16, 3)
    assert np.array_equal(frames[0, 1], discs.frames[3, 4])
    assert np.array_equal(frames[1, 2], discs.frames[1, 11])


def test_other_experts_are_paired_in_step_and_in_size():
    """i: clips of the rig, of moments that their manifest tells; j: the set's own clips, as far as i is."""
    table = clip_table(["train"] * 6 + ["validation"] * 2)
    times = "0.00 1.00 2.40 4.70 7.90"
    rig = Dataset(
        "rendered",
        disc_clips(8, size=24, length=5, seed=1),
        table.assign(times=times),
        disc_marks(8, size=24, length=5, seed=1),
    )
    own = Dataset("diverse", disc_clips(8, length=50), table, experts=rig)
    pairs = training_pairs(own, np.random.default_rng(0), 400)
    assert set(pairs.sources) == set(pairs.targets) == set(range(6))
    assert set(pairs.times) == set(range(5))
    steps = own.steps(pairs.sources, pairs.times, pairs.targets)
    assert {*zip(pairs.times, steps, strict=True)} == {(0, 0), (1, 4), (2, 14), (3, 28), (4, 48)}
    expert, target = np.split(pairs.frames(own), 2)
    assert expert.shape == target.shape == (400, SIZE, SIZE, 3)
    for n in range(0, 400, 40):
        assert np.array_equal(target[n], own.frames[pairs.targets[n], steps[n]])
        there = rig.frames[pairs.sources[n], pairs.times[n]]
        assert np.abs(expert[n].mean((0, 1)) - there.mean((0, 1))).max() < 6
    held_out = validation_pairs(own, np.random.default_rng(0), 20)
    assert set(held_out.sources) == set(held_out.targets) == {6, 7}


def test_clips_of_a_tempo_of_their_own_are_paired_by_progress():
    """j: the frame that is as far as i's, to half of what passes from one frame to the next."""
    paces = np.linspace(0.6, 1.8, 8)[:, None]
    progress = 49 * np.linspace(0, 1, LENGTH) ** paces
    table = clip_table(["train"] * 6 + ["validation"] * 2)
    text = [" ".join(f"{far:.2f}" for far in clip) for clip in progress]
    dataset = Dataset("tempo", disc_clips(8), table.assign(progress=text), disc_marks(8))
    pairs = training_pairs(dataset, np.random.default_rng(0), 300)
    steps = dataset.steps(pairs.sources, pairs.times, pairs.targets)
    apart = np.abs(progress[pairs.sources, pairs.times] - progress[pairs.targets, steps])
    assert (apart <= np.diff(progress).max() / 2 + 0.01).all()
    assert (steps != pairs.times).mean() > 0.3
    expert, target = np.split(pairs.frames(dataset), 2)
    assert np.array_equal(expert, dataset.frames[pairs.sources, pairs.times])
    assert np.array_equal(target, dataset.frames[pairs.targets, steps])
    _, marks = np.split(pairs.marks(dataset)[0], 2)
    assert np.array_equal(marks, dataset.marks[pairs.targets, steps])
    # A whole clip in step with another.
    shown = dataset.expert_clip(0, 7)
    nearest = [np.abs(progress[0] - far).argmin() for far in progress[7]]
    assert np.array_equal(shown, dataset.frames[0, nearest])
    # Several times of each pair.
    of_pairs = dataset.steps(pairs.sources[:4, None], np.arange(LENGTH)[None], pairs.targets[:4, None])
    assert np.array_equal(of_pairs[2, pairs.times[2]], steps[2])


def test_marks_of_other_experts_are_brought_to_the_size_and_step_of_the_own():
    table = clip_table(["train"] * 6 + ["validation"] * 2)
    marks = disc_marks(8, size=24, length=80, seed=1)
    rig = Dataset("rendered", disc_clips(8, size=24, length=80, seed=1), table, marks)
    own, true = disc_clips(8, length=50), disc_marks(8, length=50)
    dataset = Dataset("diverse", own, table, true, experts=rig)
    pairs = training_pairs(dataset, np.random.default_rng(0), 60)
    paired, context = pairs.marks(dataset)
    expert, target = np.split(paired, 2)
    unit = SIZE / 24
    expected = unit * (marks[pairs.sources, pairs.times] + 0.5) - 0.5
    np.testing.assert_allclose(expert, expected, rtol=1e-5)
    steps = dataset.steps(pairs.sources, pairs.times, pairs.targets)
    np.testing.assert_array_equal(target, true[pairs.targets, steps])
    np.testing.assert_array_equal(context, true[pairs.targets, 0])
    unmarked = Dataset("diverse", own, table, true, experts=Dataset("real", rig.frames, table))
    paired, _ = pairs.marks(unmarked)
    assert np.isnan(paired[:60]).all()
    np.testing.assert_array_equal(paired[60:], target)
    assert pairs.marks(Dataset("diverse", own, table, experts=rig)) is None


def test_views_are_of_one_demonstration_to_train_on():
    pairs = ["a", "b", "a", "c", "b", "d", "d"]
    splits = ["train"] * 5 + ["validation"] * 2
    dataset = Dataset("rendered", disc_clips(7), clip_table(splits, pairs))
    drawn = training_views(dataset, np.random.default_rng(0), 2000)
    views = {(0, 2), (2, 0), (1, 4), (4, 1)}
    assert set(zip(drawn.sources.tolist(), drawn.targets.tolist(), strict=True)) == views
    assert set(drawn.times) == set(range(dataset.length))


def test_demonstrations_without_a_second_view_are_refused(discs):
    with pytest.raises(
        AnyviewError, match="data set diverse: no demonstration to train on has a second view"
    ):
        training_views(discs, np.random.default_rng(0), 5)


@given(length=st.integers(1, 60), count=st.integers(1, 9))
def test_parts_keep_every_pair_once_and_in_order(length, count):
    numbers = np.arange(length)
    parts = FramePairs(numbers, numbers + 1, numbers + 2).parts(count)
    assert len(parts) == min(count, length)
    assert np.array_equal(np.concatenate([part.sources for part in parts]), numbers)
    assert np.array_equal(np.concatenate([part.times for part in parts]), numbers + 2)
    sizes = [len(part) for part in parts]
    assert max(sizes) - min(sizes) <= 1


def test_validation_frames_are_fixed_and_use_every_clip(discs):
    first, second = (validation_pairs(discs, np.random.default_rng(5), 20) for _ in range(2))
    assert np.array_equal(first.times, second.times)
    assert set(first.targets) == set(discs.split("validation"))


def test_triplets_are_two_training_clips_at_the_same_distinct_times(discs):
    pairs = training_triplets(discs, np.random.default_rng(0), 200, 10)
    frames = pairs.frames(discs)
    assert frames.shape == (400, 10, 16, 16, 3)
    assert (pairs.sources != pairs.targets).all()
    assert {*pairs.sources.flat, *pairs.targets.flat} <= set(discs.split("train"))
    assert all(len(set(times)) == 10 for times in pairs.times)
    for n in (0, 77, 199):
        for k in (0, 9):
            assert np.array_equal(frames[n, k], discs.frames[pairs.sources[n, 0], pairs.times[n, k]])
            assert np.array_equal(frames[200 + n, k], discs.frames[pairs.targets[n, 0], pairs.times[n, k]])


def test_validation_triplets_are_whole_clips(discs):
    pairs = validation_triplets(discs, 3)
    assert set(pairs.targets.flat) == set(discs.split("validation")[:3])
    assert np.array_equal(pairs.frames(discs)[3:], discs.frames[pairs.targets[:, 0]])
