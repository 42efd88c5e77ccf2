"""The curves over clips, on invented runs."""

import numpy as np

from anyview.analysis.clips import by_clips, curves, tuning
from anyview.analysis.estimates import Estimator
from tests.stage_outputs import evaluated


def test_methods_in_tuning_contexts_alone_are_on_the_curves(params):
    near = np.where(np.arange(15) < 12, 0.01, 0.1)
    methods = {
        cell: evaluated(0.3) for cell in ("ours", "clock", "clips-10", "clips-two-thirds", "clips-every-4")
    }
    methods |= {"clips-20": evaluated(near), "clips-2": evaluated(0.05)}
    table = by_clips(params, methods, Estimator(1))
    assert list(tuning(params, methods)) == list(table["cell"].unique())
    assert curves(params, table) == (
        ["clips-2", "clips-10", "clips-20"],
        ["clips-20", "clips-every-4", "clips-two-thirds"],
    )
    values = table.set_index(["cell", "metric"])["value"]
    assert values["clips-20", "runs"] == 15
    assert values["clips-20", "success_rate"] == 0.8
    assert values["clips-2", "success_rate"] == 0
    assert values["clips-20", "final_distance_median"] == 0.01
    assert values["clips-two-thirds", "final_distance_median"] == 0.3


def test_a_part_of_them_is_enough(params):
    table = by_clips(params, {"clips-two-thirds": evaluated(0.3)}, Estimator(1))
    assert curves(params, table) == ([], ["clips-two-thirds"])
    assert by_clips(params, {"ours": evaluated(0.3)}, Estimator(1)).empty
