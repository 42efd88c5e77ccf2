"""Success, distance and placed objects by angle, on invented runs and clips."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from anyview.analysis.estimates import Estimator
from anyview.analysis.study import read_study
from anyview.analysis.viewpoints import angles, by_angle, placed_by_angle
from tests.stage_outputs import evaluated


def at_angles(near: np.ndarray, far: np.ndarray):
    """A method of 15 contexts at 0 and at 180 degrees, with final distances (15,)."""
    method = evaluated(near)
    both = [
        method.runs.assign(final_distance=distance, success=distance < 0.02, context=range(15), angle=angle)
        for angle, distance in ((0, near), (180, far))
    ]
    runs = pd.concat(both, ignore_index=True)
    return replace(method, runs=runs.assign(run=runs.index))


def test_what_is_lost_from_the_smallest_angle_to_the_largest():
    near, far = np.full(15, 0.01), np.where(np.arange(15) < 3, 0.1, 0.01)
    methods = {"angles": at_angles(near, far), "ours": evaluated(0.01), "worse": at_angles(far, near)}
    table = by_angle(methods, Estimator(1))
    assert list(table["cell"].unique()) == ["angles", "worse"]
    rates = angles(table, "angles", "success_rate")
    assert dict(zip(rates["angle"], rates["value"], strict=True)) == {0: 1, 180: 0.8}
    lost = table[table["metric"] == "lost"].set_index("cell")
    assert lost["value"].to_dict() == pytest.approx({"angles": 0.2, "worse": -0.2})
    assert 0 <= lost["low"]["angles"] < 0.2 < lost["high"]["angles"]
    assert angles(table, "angles", "final_distance_median")["value"].tolist() == [0.01, 0.01]


def test_clips_are_placed_by_the_angle_between_both_cameras(params, full):
    study = read_study(params, full)
    clips = pd.DataFrame(
        {
            "clip": ["a", "b", "c", "d", "e"],
            "source": ["b", "a", "d", "c", "a"],
            "pair": ["1", "1", "2", "2", "3"],
            "split": ["validation"] * 4 + ["extreme"],
            "placed": [0.5, 0.7, 1.0, np.nan, 0.1],
        }
    )
    azimuths = pd.Series({"a": 350.0, "b": 10.0, "c": 100.0, "d": 261.0, "e": 0.0})
    translator = replace(study.translators["real-adam"], clips=clips)
    study = replace(study, translators={"real-adam": translator}, azimuths=azimuths)
    table = placed_by_angle(study, Estimator(1)).set_index("metric")["value"]
    assert table.to_dict() == pytest.approx(
        {"30.clips": 2, "30.placed": 0.6, "150.clips": 1, "150.placed": 1}
    )
    assert placed_by_angle(replace(study, azimuths=azimuths[:0]), Estimator(1)).empty
