"""Whether the clip decides, on invented runs."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from anyview.analysis.choice import against_choice, choices
from anyview.analysis.estimates import Estimator
from anyview.analysis.study import EvaluatedMethod
from tests.stage_outputs import evaluated

ESTIMATOR = Estimator(42)


def chosen(shown, other) -> EvaluatedMethod:
    """A method in 15 contexts: all with red shown, then all with green; distances (30,) to both goals."""
    runs = pd.DataFrame(
        {
            "run": range(30),
            "context": np.tile(range(15), 2),
            "choice": np.repeat(["red", "green"], 15),
            "success": np.asarray(shown) < 0.02,
            "final_distance": shown,
            "other_distance": other,
        }
    )
    return EvaluatedMethod(evaluated(0.1).folder, runs, evaluated(0.1).curve, ())


GOOD = chosen(np.where(np.arange(30) < 27, 0.01, 0.2), np.where(np.arange(30) == 29, 0.015, 0.5))
CLOCK = chosen(np.repeat([0.01, 0.6], 15), np.repeat([0.6, 0.01], 15))
METHODS = {"choice": GOOD, "choice-clock": CLOCK, "clock": evaluated(0.1)}


def test_runs_are_counted_at_either_goal():
    table = choices(METHODS, ESTIMATOR).set_index(["cell", "metric"])["value"]
    assert set(table.index.get_level_values(0)) == {"choice", "choice-clock"}
    assert table["choice", "shown_rate"] == 27 / 30
    assert table["choice", "other_rate"] == 1 / 30
    assert table["choice", "shown_distance"] == 0.01
    assert table["choice", "other_distance"] == 0.5
    assert table["choice-clock", "shown_rate"] == table["choice-clock", "other_rate"] == 0.5


def test_runs_are_paired_by_context_and_choice():
    (row,) = against_choice(METHODS, ESTIMATOR).itertuples()
    assert (row.cell, row.runs) == ("choice-clock", 30)
    difference = CLOCK.runs["final_distance"] - GOOD.runs["final_distance"]
    assert row.value == pytest.approx(difference.mean())
    # Resampled by context: the interval of 15 means, not of 30 runs.
    of_context = difference.to_numpy().reshape(2, 15).mean(axis=0)
    draws = of_context[np.random.default_rng(0).integers(15, size=(20_000, 15))].mean(axis=1)
    assert (row.low, row.high) == pytest.approx(np.quantile(draws, [0.025, 0.975]), abs=0.005)
    assert (row.only_choice, row.only_other) == (12, 0)
    assert row.p == pytest.approx(stats.binomtest(0, 12).pvalue)


def test_without_choice_nothing_is_compared():
    assert against_choice({"choice-clock": CLOCK}, ESTIMATOR).empty
    assert choices({"clock": METHODS["clock"]}, ESTIMATOR).empty
