"""Splits: exact counts, no leak between the views of a demonstration, and places that stay put."""

import shutil
import subprocess
import sys

import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anyview.runtime.errors import AnyviewError
from anyview.video.splits import read_split, split_pairs
from tests.long_stages import change


def clips(pairs: int, singles: int = 0, extreme_pairs: int = 0, kinds=("standard",)) -> pd.DataFrame:
    rows = [(f"{i}{view}", f"p{i}", kinds[i % len(kinds)]) for i in range(pairs) for view in "ab"]
    rows += [(f"{i}s", f"s{i}", "standard") for i in range(singles)]
    rows += [(f"{i}{view}", f"x{i}", "extreme_distractor") for i in range(extreme_pairs) for view in "xy"]
    return pd.DataFrame(rows, columns=["clip", "pair", "kind"])


def counts(table: pd.DataFrame) -> dict[str, int]:
    return table["split"].value_counts().to_dict()


@settings(max_examples=30)
@given(seed=st.integers(0, 1000))
def test_the_study_has_122_21_and_10_for_any_seed(seed):
    table = split_pairs(clips(71, 1, 5), seed, 122, 21)
    assert counts(table) == {"train": 122, "validation": 21, "extreme": 10}


@settings(max_examples=10)
@given(seed=st.integers(0, 1000))
def test_12_61_or_135_pairs_to_train_on_are_nested_and_the_same_clips_are_held_out(seed):
    kinds = ("standard", "distractor", "extreme_view")
    tables = [split_pairs(clips(145, 1, 5, kinds), seed, 2 * pairs, 21) for pairs in (12, 61, 135)]
    few, some, most = (table.groupby("split")["pair"].agg(set) for table in tables)
    assert few["validation"] == some["validation"] == most["validation"]
    assert few["train"] < some["train"] < most["train"]
    assert [len(each["train"]) for each in (few, some, most)] == [12, 61, 135]


@settings(max_examples=50)
@given(
    pairs=st.integers(3, 60),
    singles=st.integers(0, 5),
    extreme=st.integers(0, 4),
    seed=st.integers(0, 50),
    shares=st.one_of(
        st.tuples(st.integers(40, 100), st.integers(2, 40)),
        st.sampled_from([(0.8, 0.2), (0.5, 0.5), (0.6, 0.4)]),
    ),
)
def test_no_pair_straddles_splits(pairs, singles, extreme, seed, shares):
    table = split_pairs(clips(pairs, singles, extreme), seed, *shares)
    assert (table.groupby("pair")["split"].nunique() == 1).all()
    assert table["clip"].is_unique
    assert set(table["split"]) >= {"train", "validation"}
    assert counts(table).get("extreme", 0) == 2 * extreme
    if not isinstance(shares[0], float):
        assert counts(table)["train"] <= shares[0]
        assert counts(table)["validation"] <= max(shares[1], 2)


@settings(max_examples=30)
@given(seed=st.integers(0, 200), before=st.integers(75, 100), added=st.integers(1, 10))
def test_added_pairs_displace_no_more_pairs_than_they_are(seed, before, added):
    old = split_pairs(clips(before), seed, 122, 20).drop_duplicates("pair").set_index("pair")["split"]
    new = split_pairs(clips(before + added), seed, 122, 20).drop_duplicates("pair").set_index("pair")["split"]
    left_validation = [pair for pair in old.index[old == "validation"] if new.get(pair) != "validation"]
    entered_validation = [pair for pair in old.index[old != "validation"] if new.get(pair) == "validation"]
    assert len(left_validation) <= added
    assert entered_validation == []


def test_the_order_of_the_manifest_does_not_matter():
    table = clips(20, 2, 1)
    shuffled = table.sample(frac=1, random_state=1)
    first, second = (split_pairs(t, 7, 30, 6).set_index("clip")["split"].to_dict() for t in (table, shuffled))
    assert first == second


def test_thirty_clips_get_the_proportions_of_the_study():
    assert counts(split_pairs(clips(15), 42, 122, 21)) == {"train": 26, "validation": 4}


def test_every_kind_is_in_validation():
    table = clips(70, kinds=("standard",) * 20 + ("distractor", "extreme_view"))
    merged = split_pairs(table, 3, 120, 20).merge(table, on="clip")
    assert set(merged["kind"][merged["split"] == "validation"]) == {"standard", "distractor", "extreme_view"}


def test_too_few_clips_and_mixed_pairs_are_refused():
    with pytest.raises(AnyviewError, match="add clips"):
        split_pairs(clips(1), 0, 122, 21)
    table = clips(5)
    table.loc[0, "kind"] = "extreme_distractor"
    with pytest.raises(AnyviewError, match="p0"):
        split_pairs(table, 0, 6, 4)


def test_a_split_table_with_an_unknown_split_is_refused(tmp_path):
    (tmp_path / "real.csv").write_text("clip,pair,split\na,b,test\n")
    with pytest.raises(AnyviewError, match=r"real\.csv.*'test'"):
        read_split(tmp_path / "real.csv")


@pytest.mark.parametrize(("held_out", "expected"), [(0.25, 5), (3, 3), (20, None)])
def test_a_simulated_set_is_split_by_a_fraction_or_a_count(tmp_path, root, held_out, expected):
    folder = tmp_path / "data/clips/diverse"
    folder.mkdir(parents=True)
    pd.DataFrame({"clip": [f"c{index}" for index in range(20)]}).to_csv(folder / "manifest.csv", index=False)
    shutil.copy(root / "params.yaml", tmp_path)
    change(tmp_path, {"split.diverse.validation": held_out})
    command = [sys.executable, str(root / "stages/split.py"), "diverse"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    if expected is None:
        assert (done.returncode, "Traceback" in done.stderr) == (2, False)
        assert "split.diverse.validation: 20, but diverse has 20 clips" in done.stderr
    else:
        counts = read_split(tmp_path / "data/splits/diverse.csv")["split"].value_counts()
        assert dict(counts) == {"train": 20 - expected, "validation": expected}
