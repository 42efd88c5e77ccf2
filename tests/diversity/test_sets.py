"""Less diverse sets: the same demonstrations from fewer sides, without distractors, or fewer of them."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from anyview.diversity.sets import chosen, restrict, some_demonstrations
from anyview.pusher.contexts import sample_contexts
from anyview.pusher.expert import roll_out
from anyview.runtime.errors import AnyviewError
from anyview.video.datasets import Dataset

CONTEXTS, _ = sample_contexts(np.random.default_rng(0), 20)


def direction(azimuth: float) -> np.ndarray:
    return np.array([np.cos(azimuth), np.sin(azimuth)])


@given(azimuth=st.floats(-np.pi, np.pi), views=st.integers(1, 40))
def test_a_context_is_seen_from_the_nearest_of_so_many_views(azimuth, views):
    shown = direction(restrict(replace(CONTEXTS[0], azimuth=azimuth), views, True).azimuth)
    all_views = np.array([direction(2 * np.pi * view / views) for view in range(views)])
    assert np.linalg.norm(all_views - shown, axis=1).min() < 1e-5
    nearest = (all_views @ direction(azimuth)).max()
    assert shown @ direction(azimuth) == pytest.approx(nearest, abs=1e-5)


@pytest.mark.parametrize("views", [1, 4, 16])
def test_there_are_no_more_views_than_that_and_each_is_one_number(views):
    around = [replace(CONTEXTS[0], azimuth=azimuth) for azimuth in np.linspace(-np.pi, np.pi, 101)]
    assert len({restrict(context, views, True).azimuth for context in around}) == views


def test_nothing_else_changes_and_the_expert_does_the_same():
    assert [restrict(context, None, True) for context in CONTEXTS] == CONTEXTS
    plain = [restrict(context, 4, False) for context in CONTEXTS]
    assert all(context.distractors == () for context in plain)
    for context, shown in zip(CONTEXTS, plain, strict=True):
        assert replace(shown, azimuth=context.azimuth, distractors=context.distractors) == context
    for one, other in zip(roll_out(CONTEXTS), roll_out(plain), strict=True):
        np.testing.assert_array_equal(one, other)


def dataset(splits: list[str]) -> Dataset:
    clips = pd.DataFrame({"clip": [str(n) for n in range(len(splits))], "pair": "", "split": splits})
    return Dataset("views-4-plain", np.zeros((len(splits), 2, 4, 4, 3), np.uint8), clips)


def test_of_some_demonstrations_the_split_stays_and_the_others_have_none():
    whole = dataset(["train", "validation"] * 20)
    some = some_demonstrations(whole, 10, 1)
    kept = some.clips["split"] != ""
    assert kept.sum() == 10
    assert (some.clips["split"][kept] == whole.clips["split"][kept]).all()
    assert len(some.frames) == 40


def test_more_demonstrations_hold_the_fewer_and_another_seed_has_others():
    fewer, more, other = chosen(40, 10, 1), chosen(40, 25, 1), chosen(40, 10, 2)
    assert (more[fewer]).all()
    assert (fewer != other).any()
    assert chosen(40, 40, 1).all()


@pytest.mark.parametrize("count", [1, 3])
def test_too_few_to_learn_from_are_told(count):
    with pytest.raises(AnyviewError, match=f": {count} of views-4-plain leave none to train on, or none to"):
        some_demonstrations(dataset(["train"] * 4), count, 1)
