"""Methods compared: an order only by the corrected exact test, over enough runs."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from anyview.analysis.comparisons import differences, effects, factorial
from anyview.analysis.estimates import Estimator
from anyview.analysis.statistics import sign_flip_test
from anyview.analysis.study import EvaluatedMethod
from tests.stage_outputs import RUNS, evaluated

CONTEXT = np.random.default_rng(0).uniform(0.05, 0.4, RUNS)
ESTIMATOR = Estimator(1)


def compared(other: EvaluatedMethod, ours: EvaluatedMethod | None = None):
    """The one row of `liu` against `ours`, which needs no correction."""
    (row,) = differences({"ours": ours or evaluated(CONTEXT), "liu": other}, ESTIMATOR).itertuples()
    return row


def two_by_two(*distances: np.ndarray) -> dict[str, EvaluatedMethod]:
    cells = ("narrow-trpo", "narrow-ddpg", "liu", "ours")
    return {cell: evaluated(each) for cell, each in zip(cells, distances, strict=True)}


def test_a_small_shift_shows_in_pairs_though_contexts_differ_widely():
    noise = np.random.default_rng(1).normal(0, 0.005, RUNS)
    row = compared(evaluated(CONTEXT + 0.03 + noise))
    assert row.value == pytest.approx(0.03 + noise.mean())
    assert row.low > 0
    assert row.order == "farther"


@settings(max_examples=50)
@given(st.integers(0, 2**32))
def test_an_order_is_claimed_exactly_where_the_test_of_log_distances_is_below_5_percent(seed):
    other = np.abs(CONTEXT * np.exp(np.random.default_rng(seed).normal(0.15, 0.3, RUNS)))
    row = compared(evaluated(other))
    logs = np.log(other / CONTEXT)
    assert row.p == pytest.approx(sign_flip_test(logs))
    assert row.ratio == pytest.approx(stats.gmean(other / CONTEXT))
    side = "farther" if logs.mean() > 0 else "nearer"
    assert row.order == (side if row.p < 0.05 else "open")


def test_one_lost_run_does_not_carry_a_claim():
    """A single miss of half a metre moves the mean by 3 cm; the other runs are as ours but for luck."""
    luck = np.random.default_rng(0).normal(0, 0.3, RUNS)
    other = 0.01 * np.exp(luck)
    other[0] = 0.5
    row = compared(evaluated(other), evaluated(0.01))
    assert row.value > 0.03
    assert row.order == "open"


def test_less_than_a_millimetre_is_no_difference():
    row = compared(evaluated(0.0009), evaluated(0.00001))
    assert (row.ratio, row.p, row.order) == (1.0, 1.0, "open")


def test_every_figure_corrects_for_its_own_contrasts():
    """Holm over the methods of figure 19 and over the ablations of figure 20, each by itself."""
    rng = np.random.default_rng(4)
    methods = {"ours": evaluated(CONTEXT)} | {
        cell: evaluated(CONTEXT * np.exp(rng.normal(shift, 0.3, RUNS)))
        for cell, shift in {"oracle": 0.2, "liu": 0.25, "gail": 0.3, "no-alignment": 0.2}.items()
    }
    table = differences(methods, ESTIMATOR).set_index("cell")
    plain = {
        cell: sign_flip_test(np.log(methods[cell].runs["final_distance"] / CONTEXT)) for cell in table.index
    }
    assert table["p"]["no-alignment"] == pytest.approx(plain["no-alignment"])
    assert list(table["figure"]) == [19, 19, 19, 20]
    ranked = sorted(("oracle", "liu", "gail"), key=plain.get)
    least = 0.0
    for cell, factor in zip(ranked, (3, 2, 1), strict=True):
        least = max(least, min(1.0, factor * plain[cell]))
        assert table["p"][cell] == pytest.approx(least)


def test_only_shared_runs_are_compared():
    assert compared(evaluated(CONTEXT + 0.1, runs=range(5, RUNS))).runs == 10


def test_few_runs_carry_no_claim():
    assert compared(evaluated(CONTEXT + 0.5, runs=range(5))).order == "few"
    assert compared(evaluated(CONTEXT + 0.5, runs=range(6))).order == "farther"
    methods = {cell: evaluated(CONTEXT, runs=range(2)) for cell in ("ours", "liu", "narrow-ddpg")}
    methods["narrow-trpo"] = evaluated(CONTEXT + 0.5, runs=range(2))
    assert set(effects(methods, ESTIMATOR)["order"]) == {"few"}


def test_mcnemar_sides_are_counted():
    ours = np.where(np.arange(RUNS) < 12, 0.01, 0.1)
    other = np.where(np.arange(RUNS) >= 8, 0.01, 0.1)
    row = compared(evaluated(other), evaluated(ours))
    assert (row.only_ours, row.only_other) == (8, 3)
    assert row.p_success == pytest.approx(0.2265625)


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
    assert (data.order, learner.order) == ("nearer", "nearer")
    logs = {cell: np.log(method.runs["final_distance"]) for cell, method in methods.items()}
    halves = (logs["liu"] + logs["ours"] - logs["narrow-trpo"] - logs["narrow-ddpg"]) / 2
    assert data.ratio == pytest.approx(np.exp(halves.mean()))
    means = factorial(methods, ESTIMATOR).set_index(["contexts", "learner"])["value"]
    assert means["narrow", "DDPG"] == pytest.approx(np.mean(CONTEXT + 0.17 + noise[1]))
    assert means["diverse", "TRPO"] == pytest.approx(np.mean(CONTEXT + 0.10 + noise[2]))


def test_three_of_four_cells_are_no_two_by_two():
    methods = two_by_two(CONTEXT, CONTEXT, CONTEXT, CONTEXT)
    del methods["narrow-trpo"]
    assert effects(methods, ESTIMATOR).empty
    assert factorial(methods, ESTIMATOR).empty


def test_an_effect_that_chance_explains_is_open():
    rng = np.random.default_rng(3)
    methods = two_by_two(*(CONTEXT + rng.normal(0, 0.02, RUNS) for _ in range(4)))
    both = list(effects(methods, ESTIMATOR).itertuples())[2]
    assert both.ratio_low <= 1 <= both.ratio_high
    assert both.order == "open"
