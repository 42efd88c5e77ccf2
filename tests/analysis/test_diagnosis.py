"""Why a method does what it does: from its return table and its learning curve."""

import numpy as np
import pandas as pd
import pytest

from anyview.analysis.diagnosis import Diagnosis, diagnose
from tests.stage_outputs import evaluated


def test_a_diagnosis_reads_the_return_table_and_the_curves():
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
    returns = {
        "return_still": -65.0,
        "return_arm_only": -33.0,
        "return_expert": -12.0,
        "return_policy": -20.0,
    }
    found = diagnose(evaluated(0.05, pd.DataFrame(rows), **returns))
    assert found.distance == 0.05
    assert found.carried == pytest.approx(21 / 53)
    assert found.reached == pytest.approx(45 / 53)
    assert found.guidance == pytest.approx(1.0)
    assert found.accuracies == {"expert": 0.5}


def test_a_learned_reward_has_no_return_table():
    found = diagnose(evaluated(0.5, return_policy=3.0, return_still=np.nan))
    assert (found.worth, found.carried, found.reached, found.guidance) == (None, None, None, None)


@pytest.mark.parametrize(
    ("found", "reason"),
    [
        (Diagnosis(0.1, 0.03, -3.0, None, None, 0.5, {}), "leads away"),
        (Diagnosis(0.1, 0.03, 50.0, 0.06, 0.9, 0.9, {}), "object unseen"),
        (Diagnosis(0.9, 0.03, 50.0, 0.4, 0.9, 0.9, {}), "succeeds"),
        (Diagnosis(0.0, 0.03, None, None, None, -0.1, {"expert": 0.97}), "misguides"),
        (Diagnosis(0.1, 0.03, None, None, None, 0.8, {}), "not near enough"),
        (Diagnosis(0.1, 0.03, None, None, None, None, {}), "unknown"),
        (Diagnosis(0.1, 0.03, 50.0, 0.4, 0.2, 0.0, {}), "learner stops short"),
        (Diagnosis(0.1, 0.03, 50.0, 0.4, 0.95, 0.0, {}), "matched without the task"),
        (Diagnosis(0.1, 0.03, 50.0, 0.4, 0.95, 0.9, {}), "ends near"),
        (Diagnosis(0.1, 0.03, 50.0, 0.4, 1.1, 0.9, {}), "optimum elsewhere"),
    ],
)
def test_the_reason_is_the_first_that_the_measurements_support(found, reason):
    assert found.reason == reason
