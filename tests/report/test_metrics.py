"""The metrics that Git tracks: exact keys, true values, nothing but finite rounded numbers."""

import json

import numpy as np
import pandas as pd
import pytest

from anyview.report.inputs import read_study
from anyview.report.metrics import data_metrics, imitation_metrics, translation_metrics, write_metrics
from anyview.runtime.errors import AnyviewError

LOSSES = ("loss", "translation", "reconstruction", "alignment", "psnr", "ssim")


def bounded(*names: str) -> list[str]:
    return [f"{name}{suffix}" for name in names for suffix in ("", "_low", "_high")]


@pytest.fixture(scope="module")
def study(full, params):
    return read_study(full / "data", params)


def test_data_keys_and_values(study):
    metrics = data_metrics(study)
    assert list(metrics) == ["sim", "real"]
    assert list(metrics["sim"]) == ["diverse", "narrow"]
    diverse = metrics["sim"]["diverse"]
    assert list(diverse) == ["demos", *bounded("expert_success", "acceptance")]
    assert diverse["demos"] == 40
    assert diverse["expert_success"] == 39 / 40
    assert metrics["real"] == {
        "surrogate": 1,
        "recorded": 12,
        "refused": 1,
        "train": 6,
        "validation": 4,
        "extreme": 2,
    }


def test_translation_keys_and_values(study, full):
    metrics = translation_metrics(study)
    assert set(metrics) == set(study.params.translation.cells) - {"tcn"}
    assert list(metrics["sim"]) == ["iterations", "best_iteration", "surrogate", "validation"]
    assert list(metrics["real-adam"]) == [*metrics["sim"], "extreme"]
    assert list(metrics["sim"]["validation"]) == bounded(*LOSSES)
    assert list(metrics["real-adam"]["extreme"]) == bounded(*LOSSES, "ratio")
    assert (metrics["sim"]["surrogate"], metrics["real-adam"]["surrogate"]) == (0, 1)
    clips = pd.read_csv(full / "data/translations/real-adam/clips.csv")
    means = clips.groupby("split")["translation"].mean()
    assert metrics["real-adam"]["extreme"]["ratio"] == pytest.approx(means["extreme"] / means["validation"])


def test_imitation_keys_and_values(study, full):
    metrics = imitation_metrics(study)
    assert set(metrics) == set(study.params.imitation.cells)
    estimates = ("success_rate", "final_distance_median", "return_policy")
    table = ("return_still", "return_arm_only", "return_expert")
    assert list(metrics["ours"]) == ["runs", *bounded(*estimates, *table)]
    assert list(metrics["gail"]) == ["runs", *bounded(*estimates)]
    runs = pd.read_csv(full / "data/policies/ours/runs.csv")
    assert metrics["ours"]["success_rate"] == runs["success"].mean()
    assert metrics["ours"]["final_distance_median"] == runs["final_distance"].median()


def test_every_interval_holds_its_value(study):
    def check(tree):
        for key, value in tree.items():
            if isinstance(value, dict):
                check(value)
            elif f"{key}_low" in tree:
                assert tree[f"{key}_low"] <= value <= tree[f"{key}_high"]

    for metrics in (data_metrics(study), translation_metrics(study), imitation_metrics(study)):
        check(metrics)


def test_written_metrics_are_rounded_numbers_in_a_fixed_order(tmp_path):
    path = tmp_path / "metrics.json"
    write_metrics(path, {"b": {"count": 12_345, "loss": 11_562.49, "share": 0.123456}, "a": 1})
    assert path.read_text().endswith("\n")
    values = json.loads(path.read_text())
    assert list(values) == ["b", "a"]
    assert values["b"] == {"count": 12_345, "loss": 11_560.0, "share": 0.1235}


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_number_that_is_not_finite_is_refused(tmp_path, value):
    with pytest.raises(AnyviewError, match=r"metrics\.json: ours: loss is not a finite number"):
        write_metrics(tmp_path / "metrics.json", {"ours": {"loss": value}})
    assert not list(tmp_path.iterdir())


def test_only_cells_that_exist(data, params):
    data.translator("sim")
    data.policies("ours", 0.03)
    data.policies("oracle", 0.02)
    study = read_study(data.root / "data", params)
    assert data_metrics(study) == {"sim": {}}
    assert set(translation_metrics(study)) == {"sim"}
    assert set(imitation_metrics(study)) == {"ours", "oracle"}


def test_nothing_to_report_is_said(tmp_path, params):
    with pytest.raises(AnyviewError, match="nothing to report on yet"):
        read_study(tmp_path / "data", params)


@pytest.mark.parametrize(
    ("file", "content"),
    [
        ("policies/ours/runs.csv", "run,success\n0,True\n"),
        ("policies/ours/runs.csv", "run,success,final_distance\n0,True,near\n"),
        ("policies/ours/runs.csv", "run,success,final_distance\n0,True,\n"),
        ("policies/ours/runs.csv", "run,success,final_distance\n"),
        ("policies/ours/curve.csv", "\x00\x01"),
        ("models/sim/model.json", "{"),
        ("models/sim/model.json", "{}"),
        ("translations/sim/clips.csv", "clip,split\n"),
    ],
)
def test_a_broken_input_is_named(data, params, file, content):
    data.translator("sim")
    data.policies("ours", 0.03)
    (data.root / "data" / file).write_text(content)
    with pytest.raises(AnyviewError, match=file.rsplit("/", 1)[1]):
        read_study(data.root / "data", params)
