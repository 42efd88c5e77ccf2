"""Value order and refused failures, on invented scores whose answer can be counted by hand."""

import pandas as pd
import pytest

from anyview.analysis.estimates import Estimator
from anyview.analysis.ranking import failures, ranked
from anyview.analysis.study import Rankings

RETURNS = {  # of a method, in each of two contexts
    "ours": [
        {"good": [-1, -3], "still": [-9], "stopped": [-2, -4]},
        {"good": [-1], "still": [-9], "stopped": [-5]},
    ],
    "clock": [{"good": [7, 7], "still": [7], "stopped": [7, 7]}] * 2,
}
VALUES = {"ours": [[1, 2, 4, 3], [1, 2, 3, 4]], "clock": [[1, 5, 6, 9], [0, 0, 0, 0]]}


def rankings() -> Rankings:
    rollouts = [
        (cell, context, context, kind, index, 0.0, value)
        for cell, contexts in RETURNS.items()
        for context, kinds in enumerate(contexts)
        for kind, returns in kinds.items()
        for index, value in enumerate(returns)
    ]
    values = [
        (cell, context, context, step, value)
        for cell, contexts in VALUES.items()
        for context, row in enumerate(contexts)
        for step, value in enumerate(row)
    ]
    names = ["cell", "context", "run", "kind", "rollout", "final_distance", "return"]
    return Rankings(
        pd.DataFrame(rollouts, columns=names),
        pd.DataFrame(values, columns=["cell", "context", "run", "step", "value"]),
    )


def test_pairs_are_counted_within_a_context_and_ties_refuse_nothing():
    table = ranked(rankings(), Estimator(1))
    assert failures(table) == ["still", "stopped"]
    value = table.set_index(["cell", "metric"])["value"]
    # In the first context -4 is below -1 and -3, and -2 is below -1 alone; in the second -5 is below -1.
    assert value["ours", "refused.stopped"] == (3 / 4 + 1) / 2
    assert value["ours", "refused.still"] == 1
    assert value["ours", "refused"] == (1 + 7 / 8) / 2
    assert value["ours", "value_order"] == pytest.approx((0.8 + 1) / 2)
    assert value["clock", "refused"] == 0
    assert value["clock", "value_order"] == 0.5  # a value that never changes tells no order
    bounds = table.set_index(["cell", "metric"]).loc[("ours", "refused.stopped")]
    assert (bounds["low"], bounds["high"]) == (0.75, 1)


def test_without_rankings_there_is_nothing():
    assert ranked(None, Estimator(1)).empty
