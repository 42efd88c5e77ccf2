"""The metrics that Git tracks: exact keys, true values, nothing but finite rounded numbers."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest

from anyview.analysis.estimates import Estimate, tidy, without_interval
from anyview.analysis.metrics import details, metrics, write_metrics
from anyview.analysis.results import analyse
from anyview.analysis.study import read_study
from anyview.runtime.errors import AnyviewError
from tests.review.commands import run

LOSSES = ("loss", "translation", "reconstruction", "alignment", "psnr", "ssim")
STILL = ("copy_loss", "mean_loss")
PLACED = ("placed", "placed_on_way", "copy_placed")


def bounded(*names: str) -> list[str]:
    return [f"{name}{suffix}" for name in names for suffix in ("", "_low", "_high")]


@pytest.fixture(scope="module")
def study(full, params):
    return read_study(params, full)


@pytest.fixture(scope="module")
def trees(study):
    return metrics(analyse(study))


def test_data_keys_and_values(trees):
    data = trees["data"]
    assert list(data) == ["sim", "real"]
    assert list(data["sim"]) == ["diverse", "narrow"]
    diverse = data["sim"]["diverse"]
    assert list(diverse) == ["demos", *bounded("expert_success", "acceptance")]
    assert diverse["demos"] == 40
    assert diverse["expert_success"] == 39 / 40
    assert data["real"] == {
        "surrogate": 1,
        "recorded": 12,
        "refused": 1,
        "train": 6,
        "validation": 4,
        "extreme": 2,
    }


def test_translation_keys_and_values(trees, study, full):
    translation = trees["translation"]
    assert list(translation) == list(study.translators)
    assert list(translation["sim"]) == ["iterations", "best_iteration", "surrogate", "validation"]
    assert list(translation["real-adam"]) == [*translation["sim"], "extreme"]
    assert list(translation["sim"]["validation"]) == bounded(*LOSSES, *STILL, *PLACED)
    assert list(translation["real-adam"]["extreme"]) == bounded(*LOSSES, *STILL, *PLACED, "ratio")
    assert list(translation["real-adadelta"]["validation"]) == bounded(*LOSSES, *STILL)  # nothing is blue
    assert (translation["sim"]["surrogate"], translation["real-adam"]["surrogate"]) == (0, 1)
    assert (translation["sim"]["iterations"], translation["sim"]["best_iteration"]) == (520, 480)
    clips = pd.read_csv(full / "data/translations/real-adam/clips.csv")
    means = clips.groupby("split")["translation"].mean()
    ratio = means["extreme"] / means["validation"]
    assert translation["real-adam"]["extreme"]["ratio"] == pytest.approx(ratio, rel=5e-4)
    placed = clips["placed"][clips["split"] == "extreme"].mean()
    assert translation["real-adam"]["extreme"]["placed"] == pytest.approx(placed, rel=5e-4)


def test_imitation_keys_and_values(trees, study, full):
    imitation = trees["imitation"]
    assert set(imitation) == set(study.methods)
    estimates = ("success_rate", "final_distance_median", "return_policy")
    table = ("return_still", "return_arm_only", "return_expert")
    assert list(imitation["ours"]) == ["runs", *bounded(*estimates, *table)]
    assert list(imitation["gail"]) == ["runs", *bounded(*estimates)]
    runs = pd.read_csv(full / "data/policies/ours/runs.csv")
    assert imitation["ours"]["success_rate"] == pytest.approx(runs["success"].mean(), rel=5e-4)
    median = runs["final_distance"].median()
    assert imitation["ours"]["final_distance_median"] == pytest.approx(median, rel=5e-4)


def test_every_interval_holds_its_value(trees):
    def check(tree):
        for key, value in tree.items():
            if isinstance(value, dict):
                check(value)
            elif f"{key}_low" in tree:
                assert tree[f"{key}_low"] <= value <= tree[f"{key}_high"]

    for tree in trees.values():
        check(tree)


def test_the_summary_fits_a_screen_and_agrees_with_the_details(trees, study):
    summary = trees["summary"]
    assert all(isinstance(value, int | float) for group in summary.values() for value in group.values())
    assert sum(map(len, summary.values())) <= 60
    imitation, translation = trees["imitation"], trees["translation"]
    for cell in study.methods:
        assert summary["success_percent"][cell] == round(100 * imitation[cell]["success_rate"])
        distance = 100 * imitation[cell]["final_distance_median"]
        assert summary["distance_cm"][cell] == pytest.approx(distance, abs=0.051)
    for cell in study.translators:
        loss = translation[cell]["validation"]["loss"]
        assert summary["held_out_loss"][cell] == pytest.approx(loss, rel=0.05)
    assert summary["data"] == {
        "diverse_demonstrations": 40,
        "narrow_demonstrations": 40,
        "real_refused": 1,
        "real_train": 6,
        "real_validation": 4,
        "real_extreme": 2,
    }


def test_dvc_shows_a_screenful_when_every_metric_changed(trees, tmp_path, root):
    """By the real `dvc metrics diff`, on the repository's own pipeline."""
    for name in ("dvc.yaml", "params.yaml"):
        shutil.copy(root / name, tmp_path)
    (tmp_path / "metrics").mkdir()
    write_metrics(tmp_path / "metrics", trees)
    for command in ("git init -q", "dvc init -q", "git add -A", "git commit -qm start"):
        run(tmp_path, *command.split())
    changed = {
        group: {cell: value + 1 for cell, value in cells.items()} for group, cells in trees["summary"].items()
    }
    (tmp_path / "metrics" / "summary.json").write_text(json.dumps(changed))
    lines = run(tmp_path, "dvc", "metrics", "diff").splitlines()
    rows = [line for line in lines if line.startswith("metrics/summary.json")]
    assert len(rows) == sum(map(len, changed.values()))
    assert len(lines) <= 60


def test_a_change_below_the_last_digit_does_not_show_in_the_summary(trees, study):
    nearly = analyse(study)
    losses = nearly.translation["metric"] == "validation.loss"
    nearly.translation.loc[losses, "value"] *= 1.0001
    assert metrics(nearly)["summary"] == trees["summary"]
    assert metrics(nearly)["translation"] != trees["translation"]


def test_details_are_rounded_and_in_a_fixed_order():
    rows = [
        ("b", "count", without_interval(12_345)),
        ("b", "validation.loss", Estimate(11_562.49, 11_000.1, 12_000.4)),
        ("a", "fraction", Estimate(0.123456, 0.1, 0.2)),
    ]
    tree = details(tidy(rows))
    assert list(tree) == ["b", "a"]
    assert tree["b"]["count"] == 12_345
    assert tree["b"]["validation"] == {"loss": 11_560.0, "loss_low": 11_000.0, "loss_high": 12_000.0}
    assert tree["a"]["fraction"] == 0.1235


def test_metrics_are_files_of_json(tmp_path):
    write_metrics(tmp_path, {"summary": {"a": {"b": 1}}})
    text = (tmp_path / "summary.json").read_text()
    assert json.loads(text) == {"a": {"b": 1}}
    assert text.endswith("\n")


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_number_that_is_not_finite_is_refused(study, value):
    results = analyse(study)
    results.imitation.loc[results.imitation["metric"] == "return_policy", "value"] = value
    with pytest.raises(AnyviewError, match=r"imitation\.json: ours: return_policy is not a finite number"):
        metrics(results)


def test_only_cells_that_exist(data, params):
    data.translator("sim")
    data.policies("ours", 0.03)
    data.policies("oracle", 0.02)
    trees = metrics(analyse(read_study(params, data.root)))
    assert trees["data"] == {}
    assert set(trees["translation"]) == {"sim"}
    assert set(trees["imitation"]) == {"ours", "oracle"}
