"""The smoke profile through the real ``dvc repro``, in a clone, and from there to other machines."""

import json
import math
import shutil
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from anyview.config import load_params
from tests.long_stages import digests
from tests.test_setup import steps

BOUNDS = ("", "_low", "_high")


@pytest.fixture(scope="module")
def metrics(smoke) -> dict[str, Any]:
    folder = smoke.folder / "metrics"
    return {path.stem: json.loads(path.read_text()) for path in folder.glob("*.json")}


def leaves(tree: Any, path: tuple[str, ...] = ()):
    if isinstance(tree, dict):
        for key, branch in tree.items():
            yield from leaves(branch, (*path, key))
    else:
        yield ".".join(path), tree


def test_the_second_run_has_nothing_to_do(smoke):
    before = {path: path.stat().st_mtime_ns for path in (smoke.folder / "metrics").rglob("*")}
    assert "Data and pipelines are up to date." in smoke.run("dvc", "repro")
    assert {path: path.stat().st_mtime_ns for path in (smoke.folder / "metrics").rglob("*")} == before
    assert "up to date" in smoke.run("dvc", "status")


def test_every_stage_left_its_outputs(smoke):
    params = load_params(smoke.folder / "params.yaml")
    for folder, cells in {
        "clips": params.split,
        "models": [*params.translators, *params.embeddings],
        "policies": params.methods,
    }.items():
        for cell in cells:
            assert any((smoke.folder / "data" / folder / cell).iterdir()), cell
    assert (smoke.folder / "data" / "report" / "index.html").is_file()
    assert [path for path in smoke.folder.rglob(".*.partial")] == []


def test_results_hold_no_trace_of_time_or_place(smoke):
    """A cache has to hit on another machine."""
    for path in [*smoke.folder.glob("data/**/*.csv"), *smoke.folder.glob("data/**/*.json")]:
        text = path.read_text()
        assert str(smoke.folder) not in text, path
        assert str(smoke.scratch) not in text, path
        assert time.strftime("%Y-%m-") not in text, path


def test_git_sees_results_and_nothing_else(smoke):
    """Data belongs to DVC; metrics and the lock belong to Git."""
    status = smoke.run("git", "status", "--porcelain", "--untracked-files=all").splitlines()
    changed = {line[3:] for line in status}
    allowed = ("metrics/", "dvc.lock", "params.yaml")
    assert [
        name for name in changed if not name.startswith(allowed) and not name.endswith(".gitignore")
    ] == []


def test_dvc_draws_the_plots_also_those_of_a_training_that_goes_on(smoke):
    live = smoke.folder / "metrics/live/sim.csv"
    assert "failed" not in smoke.run("sh", "-c", "dvc plots show 2>&1")
    live.write_text("iteration,loss,validation_loss\n2,9.0,8765.4\n4,8.0,7654.3\n")
    assert "failed" not in smoke.run("sh", "-c", "dvc plots show -o growing 2>&1")
    live.unlink()
    page = (smoke.folder / "growing/index.html").read_text()
    assert "Translators in training" in page
    assert "8765.4" in page
    for folder in ("dvc_plots", "growing"):
        shutil.rmtree(smoke.folder / folder)


def test_a_report_that_fails_leaves_the_metrics_as_they_were(smoke, tmp_path):
    study = smoke.copy(tmp_path)
    (study.folder / "data/policies/ours/runs.csv").write_text("not a table of runs\n")
    before = digests(study.folder / "metrics")
    process = study.start("dvc", "repro", "--single-item", "report")
    said = "".join(process.communicate())
    assert process.returncode != 0
    assert "data/policies/ours/runs.csv: " in said
    assert digests(study.folder / "metrics") == before


@pytest.mark.parametrize(
    ("before", "after", "fails", "said"),
    [
        ("base:", "bass: 1\nbase:", True, "error: params.yaml: bass: unknown key"),
        (
            "warmup_episodes: 1",
            "warmup_episodes: 1000",
            False,
            "fewer than ddpg.warmup_episodes 1000: DDPG learns nothing",
        ),
    ],
)
def test_what_no_stage_reads_is_checked_as_well(smoke, tmp_path, before, after, fails, said):
    """An up-to-date tree, so that no other stage runs."""
    study = smoke.copy(tmp_path)
    path = study.folder / "params.yaml"
    assert before in path.read_text()
    path.write_text(path.read_text().replace(before, after, 1))
    process = study.start("dvc", "repro", "check")
    output = "".join(process.communicate())
    assert (process.returncode != 0) == fails
    assert said in output
    assert "Traceback" not in output


def test_metrics_are_plain_rounded_numbers(metrics):
    assert metrics.keys() == {"summary", "data", "translation", "imitation"}
    for name, value in leaves(metrics):
        assert isinstance(value, int | float), name
        assert not isinstance(value, bool), name
        assert math.isfinite(value), name
        assert value == float(f"{value:.4g}") or value == round(value, 4), name


def test_metrics_of_data(metrics):
    for kind, demos in (("diverse", 24), ("narrow", 16)):
        assert metrics["data"]["sim"][kind]["demos"] == demos
        assert metrics["data"]["sim"][kind].keys() >= {"demos", "expert_success", "acceptance"}
    real = metrics["data"]["real"]
    assert real["surrogate"] == 1
    assert real["recorded"] == real["train"] + real["validation"] + real["extreme"]
    assert real["refused"] >= 0


def test_metrics_of_translation(smoke, metrics):
    cells = load_params(smoke.folder / "params.yaml").translators
    assert metrics["translation"].keys() == cells.keys()
    for name, values in metrics["translation"].items():
        assert values.keys() >= {"iterations", "best_iteration", "surrogate", "validation"}
        assert values["iterations"] == 4
        assert values["surrogate"] == int(cells[name].dataset == "real")
        for part in ("validation", "extreme") if cells[name].dataset == "real" else ("validation",):
            for measure in ("loss", "translation", "reconstruction", "alignment", "psnr", "ssim"):
                assert {measure + bound for bound in BOUNDS} <= values[part].keys()
        assert ("extreme" in values) == (cells[name].dataset == "real")
        if "extreme" in values:
            assert "ratio" in values["extreme"]


def test_metrics_of_imitation(smoke, metrics):
    cells = load_params(smoke.folder / "params.yaml").methods
    assert metrics["imitation"].keys() == cells.keys()
    for name, values in metrics["imitation"].items():
        assert values["runs"] == 2
        for measure in ("success_rate", "final_distance_median", "return_policy"):
            low, mean, high = (values[measure + bound] for bound in ("_low", "", "_high"))
            assert low <= mean <= high, (name, measure)
        assert ("return_expert" in values) == (cells[name].reward not in ("tpil", "gail"))


def test_results_travel_through_a_shared_folder(smoke, tmp_path):
    """``dvc push`` here, ``dvc pull`` there: the same bytes, and nothing to run again."""
    study = smoke.copy(tmp_path)
    study.run("dvc", "remote", "add", "--default", "shared", str(tmp_path / "remote"))
    study.run("dvc", "push")
    other = study.clone(tmp_path / "clone")
    other.run("dvc", "pull")
    assert digests(other.folder / "data") == digests(study.folder / "data")
    assert "up to date" in other.run("dvc", "repro")


def test_another_clone_can_use_the_run_cache(smoke, tmp_path):
    """Without the lock file: ``dvc repro`` recognises what somebody else has run, and fetches it."""
    study = smoke.copy(tmp_path)
    study.run("dvc", "remote", "add", "--default", "shared", str(tmp_path / "remote"))
    study.run("dvc", "push", "--run-cache")
    other = study.clone(tmp_path / "clone")
    (other.folder / "dvc.lock").unlink()
    other.run("dvc", "pull", "--run-cache", "--allow-missing")
    said = other.run("dvc", "repro", "--pull", "simulate@narrow")
    assert "Stage 'simulate@narrow' is cached" in said


@pytest.mark.parametrize(("job", "said"), [("smoke", "## Anyview"), ("review", "## Anyview")])
def test_the_workflow_scripts_run(smoke, tmp_path, job, said):
    """The very text of the steps, but for the one that talks to GitHub."""
    (smoke.folder / ".venv").unlink(missing_ok=True)
    (smoke.folder / ".venv").symlink_to(Path(sys.executable).parents[1])
    for stamp in (".setup-stamp", ".setup-stamp-dev", ".setup-stamp-graphics"):
        (smoke.folder / stamp).touch()
    summary = tmp_path / "summary.md"
    head = smoke.run("git", "rev-parse", "HEAD").strip()
    for script in steps(job):
        if "gh pr comment" not in script:
            smoke.run(
                "bash",
                "-e",
                "-c",
                script,
                GITHUB_STEP_SUMMARY=str(summary),
                BASE=head,
                IMAGES="https://example.org",
            )
    assert said in summary.read_text()
