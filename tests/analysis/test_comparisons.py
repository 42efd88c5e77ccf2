"""Methods compared: an order only where the paired interval excludes zero, over enough runs."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anyview.analysis.comparisons import differences, effects, factorial
from anyview.analysis.estimates import Estimator
from anyview.analysis.study import EvaluatedMethod
from tests.stage_outputs import RUNS, evaluated

CONTEXT = np.random.default_rng(0).normal(0.2, 0.1, RUNS)
ESTIMATOR = Estimator(1)


def compared(other: EvaluatedMethod, ours: EvaluatedMethod | None = None):
    """The one row of `liu` against `ours`."""
    (row,) = differences({"ours": ours or evaluated(CONTEXT), "liu": other}, ESTIMATOR).itertuples()
    return row


def two_by_two(*distances: np.ndarray) -> dict[str, EvaluatedMethod]:
    cells = ("liu", "narrow-ddpg", "ours-trpo", "ours")
    return {cell: evaluated(each) for cell, each in zip(cells, distances, strict=True)}


def test_a_small_shift_shows_in_pairs_though_contexts_differ_widely():
    noise = np.random.default_rng(1).normal(0, 0.005, RUNS)
    row = compared(evaluated(CONTEXT + 0.03 + noise))
    assert row.value == pytest.approx(0.03 + noise.mean())
    assert row.low > 0
    assert row.order == "farther"


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 2**32))
def test_an_order_is_claimed_exactly_where_the_interval_excludes_zero(seed):
    row = compared(evaluated(CONTEXT + np.random.default_rng(seed).normal(0.01, 0.03, RUNS)))
    sides = {row.low > 0: "farther", row.high < 0: "nearer"}
    assert row.order == sides.get(True, "open")


def test_only_shared_runs_are_compared():
    assert compared(evaluated(CONTEXT + 0.1, runs=range(5, RUNS))).runs == 10


def test_few_runs_carry_no_claim():
    assert compared(evaluated(CONTEXT + 0.5, runs=range(5))).order == "few"
    assert compared(evaluated(CONTEXT + 0.5, runs=range(6))).order == "farther"
    methods = {cell: evaluated(CONTEXT, runs=range(2)) for cell in ("ours", "ours-trpo", "narrow-ddpg")}
    methods["liu"] = evaluated(CONTEXT + 0.5, runs=range(2))
    assert set(effects(methods, ESTIMATOR)["order"]) == {"few"}


def test_mcnemar_sides_are_counted():
    ours = np.where(np.arange(RUNS) < 12, 0.01, 0.1)
    other = np.where(np.arange(RUNS) >= 8, 0.01, 0.1)
    row = compared(evaluated(other), evaluated(ours))
    assert (row.only_ours, row.only_other) == (8, 3)
    assert row.p == pytest.approx(0.2265625)


def test_without_ours_nothing_is_compared():
    assert differences({"liu": evaluated(CONTEXT)}, ESTIMATOR).empty


def test_the_two_by_two_finds_what_was_put_in():
    noise = np.random.default_rng(2).normal(0, 0.002, (4, RUNS))
    methods = two_by_two(
        CONTEXT + 0.20 + noise[0],
        CONTEXT + 0.17 + noise[1],
        CONTEXT + 0.10 + noise[2],
        CONTEXT + 0.02 + noise[3],
    )
    data, learner, both = effects(methods, ESTIMATOR).itertuples()
    assert data.value == pytest.approx(-0.125, abs=0.003)
    assert learner.value == pytest.approx(-0.055, abs=0.003)
    assert both.value == pytest.approx(-0.05, abs=0.004)
    assert data.order == "nearer"
    means = factorial(methods, ESTIMATOR).set_index(["contexts", "learner"])["value"]
    assert means["narrow", "DDPG"] == pytest.approx(np.mean(CONTEXT + 0.17 + noise[1]))
    assert means["diverse", "TRPO"] == pytest.approx(np.mean(CONTEXT + 0.10 + noise[2]))


def test_three_of_four_cells_are_no_two_by_two():
    methods = two_by_two(CONTEXT, CONTEXT, CONTEXT, CONTEXT)
    del methods["liu"]
    assert effects(methods, ESTIMATOR).empty
    assert factorial(methods, ESTIMATOR).empty


def test_an_effect_whose_interval_holds_zero_is_open():
    rng = np.random.default_rng(3)
    methods = two_by_two(*(CONTEXT + rng.normal(0, 0.05, RUNS) for _ in range(4)))
    both = list(effects(methods, ESTIMATOR).itertuples())[2]
    assert both.low <= 0 <= both.high
    assert both.order == "open"
