"""Intervals against independent calculations."""

import math
from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from anyview.analysis.estimates import Estimator, proportion, tidy, without_interval
from anyview.analysis.statistics import (
    EXACT_PAIRS,
    crossed_interval,
    crossed_rate_interval,
    holm,
    mcnemar_exact,
    sign_flip_test,
    wilson_interval,
)

NORMAL_97_5 = 1.959963984540054


@given(st.integers(1, 60).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_wilson_bounds_solve_wilsons_equation(counts):
    """At a bound p, the observed rate lies exactly 1.96 standard errors (under p) away from p."""
    successes, trials = counts
    rate = successes / trials
    for bound in wilson_interval(successes, trials):
        error = NORMAL_97_5 * math.sqrt(max(bound * (1 - bound), 0) / trials)
        assert abs(abs(rate - bound) - error) < 1e-9


def test_the_thesis_success_rates_overlap_widely():
    low, high = wilson_interval(12, 15)
    assert (round(low, 3), round(high, 3)) == (0.548, 0.930)


@given(st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=9))
def test_mcnemar_counts_the_outcomes_at_least_as_rare(pairs):
    first, second = np.array(pairs).T
    wins = [a for a, b in pairs if a != b]
    n = len(wins)
    rarity = [abs(sum(outcome) - n / 2) for outcome in product([0, 1], repeat=n)]
    expected = np.mean([rare >= abs(sum(wins) - n / 2) for rare in rarity])
    assert mcnemar_exact(first, second) == pytest.approx(min(expected, 1.0))


def test_twelve_against_seven_of_fifteen_is_not_significant():
    ours = np.arange(15) < 12
    other = np.arange(15) < 7
    assert mcnemar_exact(ours, other) == pytest.approx(2 * 0.5**5)


@given(st.lists(st.integers(-20, 20), min_size=1, max_size=10))
def test_sign_flips_are_counted_one_by_one(whole):
    """With ties, which whole numbers have many of. In sevenths, so that no sum is exact."""
    sums = [
        abs(sum(sign * value for sign, value in zip(signs, whole, strict=True))) for signs in flips(whole)
    ]
    expected = np.mean([each >= abs(sum(whole)) for each in sums])
    assert sign_flip_test(np.array(whole) / 7) == pytest.approx(expected)


def flips(values) -> list[tuple[int, ...]]:
    return list(product((1, -1), repeat=len(values)))


def test_sign_flips_agree_with_scipy_at_fifteen_pairs():
    rng = np.random.default_rng(0)
    for shift in (0.0, 0.3, 1.0):
        values = rng.normal(shift, 1, 15)
        theirs = stats.permutation_test((values,), np.mean, permutation_type="samples", n_resamples=2**15)
        assert sign_flip_test(values) == pytest.approx(theirs.pvalue)


def test_of_fifteen_runs_that_agree_one_pattern_in_16384_is_as_far_out():
    assert sign_flip_test(np.arange(1, 16)) == pytest.approx(2 / 2**15)


@pytest.mark.parametrize("shift", [0.1, 0.3])
def test_many_pairs_take_the_normal_limit_which_the_count_is_close_to(shift):
    values = np.random.default_rng(1).normal(shift, 1, EXACT_PAIRS)
    counted = sign_flip_test(values)
    limit = 2 * stats.norm.sf(abs(values.sum()) / np.sqrt((values**2).sum()))
    assert counted == pytest.approx(limit, abs=0.01)
    doubled = np.concatenate([values, values])
    expected = 2 * stats.norm.sf(abs(doubled.sum()) / np.sqrt((doubled**2).sum()))
    assert sign_flip_test(doubled) == pytest.approx(expected)


@given(st.lists(st.floats(0, 1), min_size=1, max_size=7))
def test_holm_is_the_closed_test_of_bonferroni(p_values):
    """A contrast counts if in every set of contrasts that it is in, the least p times their number does."""
    corrected = holm(np.array(p_values))
    indices = range(len(p_values))
    for one in indices:
        sets = [chosen for size in indices for chosen in combinations(indices, size + 1) if one in chosen]
        worst = max(min(p_values[each] for each in chosen) * len(chosen) for chosen in sets)
        assert corrected[one] == pytest.approx(min(1.0, worst))


def test_bootstrap_of_a_mean_agrees_with_the_normal_theory():
    values = np.random.default_rng(0).normal(3, 2, 400)
    estimate = Estimator(1).mean("x", values)
    error = NORMAL_97_5 * values.std(ddof=1) / 20
    assert estimate.value == pytest.approx(values.mean())
    assert estimate.low == pytest.approx(values.mean() - error, abs=0.1 * error)
    assert estimate.high == pytest.approx(values.mean() + error, abs=0.1 * error)


def test_values_of_one_group_are_one_draw():
    """Two views that always agree carry the information of one: the interval is wider by sqrt(2)."""
    values = np.random.default_rng(0).normal(0, 1, 200)
    alone = Estimator(1).mean("x", values)
    doubled = Estimator(1).mean("x", np.repeat(values, 2), np.repeat(np.arange(200), 2))
    naive = Estimator(1).mean("x", np.repeat(values, 2))
    assert doubled.high - doubled.low == pytest.approx(alone.high - alone.low, rel=0.05)
    assert naive.high - naive.low == pytest.approx((alone.high - alone.low) / math.sqrt(2), rel=0.05)


def test_ratio_of_means_covers_the_true_ratio():
    rng = np.random.default_rng(0)
    estimate = Estimator(1).ratio_of_means("x", rng.normal(5.4, 1, 300), rng.normal(2, 0.4, 300))
    assert estimate.low < 2.7 < estimate.high
    assert estimate.high - estimate.low < 0.25


def test_a_ratio_draws_the_views_of_a_pair_together():
    """As for a mean: a doubled sample in groups of two says no more than the sample alone."""
    rng = np.random.default_rng(0)
    above, below = rng.normal(5.4, 1, 200), rng.normal(2, 0.4, 200)
    alone = Estimator(1).ratio_of_means("x", above, below)
    pairs = np.repeat(np.arange(200), 2)
    doubled = Estimator(1).ratio_of_means("x", np.repeat(above, 2), np.repeat(below, 2), (pairs, pairs))
    assert doubled.value == pytest.approx(alone.value)
    assert doubled.high - doubled.low == pytest.approx(alone.high - alone.low, rel=0.05)


def test_a_share_keeps_its_pairs():
    """Where part and whole rise and fall together the share hardly varies; drawn apart it would."""
    whole = np.random.default_rng(0).normal(10, 3, 100)
    share, apart = (
        Estimator(1).share("x", 0.4 * whole, whole),
        Estimator(1).ratio_of_means("x", 0.4 * whole, whole),
    )
    assert share.value == pytest.approx(0.4)
    assert share.high - share.low < 1e-9 < 0.02 < apart.high - apart.low


def test_bounds_repeat_and_depend_on_seed_and_name_alone():
    values = np.random.default_rng(0).normal(0, 1, 15)
    assert Estimator(1).median("x", values) == Estimator(1).median("x", values)
    assert Estimator(1).median("x", values) != Estimator(1).median("y", values)
    assert Estimator(1).median("x", values) != Estimator(2).median("x", values)


def test_a_single_run_has_no_spread():
    estimate = Estimator(1).median("x", np.array([0.25]))
    assert estimate.low == estimate.value == estimate.high == 0.25
    assert proportion(1, 1).low == pytest.approx(0.2065, abs=1e-4)


def test_a_tidy_row_has_the_thesis_value_beside_it():
    rows = [
        ("ours", "success_rate", proportion(11, 15)),
        ("real-adam", "validation.loss", without_interval(24_400)),
        ("tcn", "success_rate", proportion(3, 15)),
    ]
    table = tidy(rows).set_index(["cell", "metric"])
    ours, loss, tcn = (table.loc[row[:2]] for row in rows)
    assert (ours["thesis"], round(ours["thesis_low"], 3), round(ours["thesis_high"], 3)) == (
        0.8,
        0.548,
        0.930,
    )
    assert (loss["value"], loss["thesis"]) == (24_400, 4_232)
    assert loss[["low", "high", "thesis_low", "thesis_high"]].isna().all()
    assert np.isnan(tcn["thesis"])


def crossed(rng: np.random.Generator, models: int, contexts: int, spreads: tuple[float, float, float]):
    """(models, contexts) around 0, with the spreads of models, of contexts and of runs."""
    shapes = ((models, 1), (1, contexts), (models, contexts))
    return sum(spread * rng.normal(size=shape) for spread, shape in zip(spreads, shapes, strict=True))


@pytest.mark.parametrize("models", [2, 3, 6])
@pytest.mark.parametrize("spreads", [(1.0, 1.0, 1.0), (1.0, 0.3, 0.3), (0.3, 1.0, 1.0), (0.0, 1.0, 1.0)])
def test_an_interval_over_few_models_and_contexts_covers_what_it_should(models, spreads):
    """Of 1,000 draws; a percentile bootstrap over two models would cover seven in ten."""
    rng = np.random.default_rng(0)
    intervals = [crossed_interval(crossed(rng, models, 15, spreads)) for _ in range(1000)]
    covered = np.mean([low < 0 < high for low, high in intervals])
    assert 0.87 <= covered <= 0.99


def test_an_interval_of_many_is_as_wide_as_the_variances_say():
    rng = np.random.default_rng(0)
    widths = [np.diff(crossed_interval(crossed(rng, 40, 60, (1.0, 2.0, 3.0)))) for _ in range(200)]
    error = math.sqrt(1 / 40 + 4 / 60 + 9 / 2400)
    assert np.mean(widths) == pytest.approx(2 * NORMAL_97_5 * error, rel=0.05)


def test_the_interval_of_one_model_is_students_over_contexts():
    values = np.random.default_rng(0).normal(0, 1, 20)
    expected = stats.ttest_1samp(values, 0).confidence_interval()
    assert crossed_interval(values[None]) == pytest.approx((expected.low, expected.high))


def test_a_rate_over_models_is_wilsons_where_they_agree_and_wider_where_they_do_not():
    low, high = crossed_rate_interval(np.ones((3, 15), bool))  # as of 15 trials, not of 45
    assert (low, high) == pytest.approx((15 / (15 + stats.t.ppf(0.975, 14) ** 2), 1))
    some = np.broadcast_to(np.arange(15) < 10, (3, 15))
    one_bad = np.stack([np.arange(15) < 15, np.arange(15) < 15, np.arange(15) < 0])
    assert np.diff(crossed_rate_interval(one_bad)) > 1.5 * np.diff(crossed_rate_interval(some))


def test_a_failure_makes_no_method_look_more_certain():
    """Nor a success one that has none."""
    successes = np.ones((6, 15), bool)
    lows = []
    for failures in range(4):
        successes[:failures, 3] = False
        lows.append(crossed_rate_interval(successes)[0])
    assert (np.diff(lows) < 1e-12).all()
    assert crossed_rate_interval(~successes)[1] == pytest.approx(1 - lows[-1])


@given(st.integers(1, 6), st.integers(2, 20), st.integers(0, 2**32 - 1))
def test_bounds_of_a_rate_hold_it_and_stay_within_0_and_1(models, contexts, seed):
    rng = np.random.default_rng(seed)
    successes = rng.random((models, contexts)) < rng.random()
    low, high = crossed_rate_interval(successes)
    assert -1e-9 <= low <= successes.mean() + 1e-9
    assert successes.mean() - 1e-9 <= high <= 1 + 1e-9
