"""Comparisons and the words for them: an order only where the paired interval excludes zero."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anyview.report.comparisons import compare_with_ours, factorial_effects
from anyview.report.findings import Anatomy, anatomy, claims, effect_sentence, order, why
from anyview.report.inputs import Evaluation

RUNS = 15
CONTEXT = np.random.default_rng(0).normal(0.2, 0.1, RUNS)


def evaluation(distance, curve=None, **returns) -> Evaluation:
    distance = np.broadcast_to(distance, RUNS)
    runs = pd.DataFrame(
        {"run": range(RUNS), "success": distance < 0.02, "final_distance": distance, **returns}
    )
    if curve is None:
        curve = pd.DataFrame({"iteration": [0], "run": [0], "final_distance": [0.5], "return": [-1.0]})
    return Evaluation(Path(), runs, curve, ())


def test_a_small_shift_shows_in_pairs_though_contexts_differ_widely():
    noise = np.random.default_rng(1).normal(0, 0.005, RUNS)
    (entry,) = compare_with_ours(
        {"ours": evaluation(CONTEXT), "liu": evaluation(CONTEXT + 0.03 + noise)}, seed=1
    )
    assert entry.difference.value == pytest.approx(0.03 + noise.mean())
    assert entry.difference.low > 0
    assert order(entry) == "farther"
    assert claims([entry])[0].startswith("Farther from the goal than ours: Liu")


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 2**32))
def test_an_order_is_claimed_exactly_where_the_interval_excludes_zero(seed):
    other = evaluation(CONTEXT + np.random.default_rng(seed).normal(0.01, 0.03, RUNS))
    (entry,) = compare_with_ours({"ours": evaluation(CONTEXT), "gail": other}, seed=1)
    open_ = entry.difference.low <= 0 <= entry.difference.high
    assert (order(entry) == "open") is open_
    assert claims([entry])[0].startswith("No order can be claimed") is open_


def test_only_shared_runs_are_compared():
    other = evaluation(CONTEXT + 0.1)
    part = Evaluation(Path(), other.runs[other.runs["run"] > 4], other.curve, ())
    (entry,) = compare_with_ours({"ours": evaluation(CONTEXT), "liu": part}, seed=1)
    assert entry.runs == 10


def test_two_runs_carry_no_claim():
    far = evaluation(CONTEXT + 0.5)
    cells = {cell: evaluation(CONTEXT) for cell in ("ours", "ours-trpo", "narrow-ddpg")} | {"liu": far}
    few = {cell: Evaluation(Path(), each.runs.head(2), each.curve, ()) for cell, each in cells.items()}
    assert all(order(entry) == "open" for entry in compare_with_ours(few, seed=1))
    assert all("too few" in effect_sentence(effect) for effect in factorial_effects(few, seed=1))


def test_mcnemar_sides_are_counted():
    ours = np.where(np.arange(RUNS) < 12, 0.01, 0.1)
    other = np.where(np.arange(RUNS) >= 8, 0.01, 0.1)
    (entry,) = compare_with_ours({"ours": evaluation(ours), "liu": evaluation(other)}, seed=1)
    assert (entry.only_ours, entry.only_other) == (8, 3)


def test_without_ours_nothing_is_compared():
    assert compare_with_ours({"liu": evaluation(CONTEXT)}, seed=1) == []


def test_the_two_by_two_finds_what_was_put_in():
    noise = np.random.default_rng(2).normal(0, 0.002, (4, RUNS))
    cells = {
        "liu": evaluation(CONTEXT + 0.20 + noise[0]),
        "narrow-ddpg": evaluation(CONTEXT + 0.17 + noise[1]),
        "ours-trpo": evaluation(CONTEXT + 0.10 + noise[2]),
        "ours": evaluation(CONTEXT + 0.02 + noise[3]),
    }
    data, learner, both = factorial_effects(cells, seed=1)
    assert data.size.value == pytest.approx(-0.125, abs=0.003)
    assert learner.size.value == pytest.approx(-0.055, abs=0.003)
    assert both.size.value == pytest.approx(-0.05, abs=0.004)
    assert "nearer to the goal" in effect_sentence(data)
    assert factorial_effects({"ours": cells["ours"]}, seed=1) == []


def test_an_effect_whose_interval_holds_zero_is_not_claimed():
    rng = np.random.default_rng(3)
    cells = {
        cell: evaluation(CONTEXT + rng.normal(0, 0.05, RUNS))
        for cell in ("liu", "narrow-ddpg", "ours-trpo", "ours")
    }
    effect = factorial_effects(cells, seed=1)[2]
    assert not effect.size.excludes_zero
    assert "no effect is claimed" in effect_sentence(effect)


def test_anatomy_reads_the_return_table_and_the_curves():
    rows = [
        {
            "iteration": step,
            "run": run,
            "final_distance": 0.5 - 0.01 * step,
            "return": step + run,
            "expert_accuracy": 0.5,
        }
        for run in range(3)
        for step in range(20)
    ]
    measured = anatomy(
        evaluation(
            0.05,
            pd.DataFrame(rows),
            return_still=-65.0,
            return_arm_only=-33.0,
            return_expert=-12.0,
            return_policy=-20.0,
        )
    )
    assert measured.distance == 0.05
    assert measured.carried == pytest.approx(21 / 53)
    assert measured.reached == pytest.approx(45 / 53)
    assert measured.guidance == pytest.approx(1.0)
    assert measured.accuracies == {"expert": 0.5}


def test_anatomy_of_a_learned_reward_has_no_return_table():
    measured = anatomy(evaluation(0.5, return_policy=3.0, return_still=np.nan))
    assert (measured.worth, measured.carried, measured.reached, measured.guidance) == (None, None, None, None)


@pytest.mark.parametrize(
    ("measured", "words"),
    [
        (Anatomy(0.1, 0.03, -3.0, None, None, 0.5, {}), "leads away from the task"),
        (Anatomy(0.1, 0.03, 50.0, 0.06, 0.9, 0.9, {}), "already earns 94%"),
        (Anatomy(0.9, 0.03, 50.0, 0.4, 0.9, 0.9, {}), "succeeds"),
        (
            Anatomy(0.0, 0.03, None, None, None, -0.1, {"expert": 0.97}),
            "right: expert 97%): following this reward is not",
        ),
        (Anatomy(0.1, 0.03, None, None, None, 0.8, {}), "not near enough"),
        (Anatomy(0.1, 0.03, None, None, None, None, {}), "–"),
        (Anatomy(0.1, 0.03, 50.0, 0.4, 0.2, 0.0, {}), "wins only 20%"),
        (Anatomy(0.1, 0.03, 50.0, 0.4, 0.95, 0.0, {}), "matched without doing the task"),
        (
            Anatomy(0.1, 0.03, 50.0, 0.4, 0.95, 0.9, {}),
            "ends 3.0\u00a0cm from the goal: the reward takes no more than 5%",
        ),
        (Anatomy(0.1, 0.03, 50.0, 0.4, 1.1, 0.9, {}), "optimum is not the goal"),
    ],
)
def test_the_reason_follows_from_the_measurements(measured, words):
    assert words in why(measured)
