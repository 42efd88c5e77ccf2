"""`anyview review` against real Git repositories."""

import json
import subprocess
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from anyview.cli.review import review
from anyview.report.review import MetricChange, Reading, compare
from anyview.report.revisions import Revision, find_revision
from anyview.runtime.errors import AnyviewError

PARAMS = "base: {seed: 42}\nimitation:\n  reward: {phi: 0.3}\n"
METRICS = {"ours": {"runs": 15, "success_rate": 0.8, "success_rate_low": 0.55, "success_rate_high": 0.93}}
LOCK = """schema: '2.0'
stages:
  imitate@ours:
    cmd: python stages/imitate.py ours
    deps:
    - {path: src/anyview/learners/ddpg.py, hash: md5, md5: aaa, size: 1}
    params:
      params.yaml:
        imitation.reward: {phi: PHI}
    outs:
    - {path: data/policies/ours, hash: md5, md5: OUT.dir, size: 1, nfiles: 1}
  simulate@diverse:
    cmd: python stages/simulate.py diverse
    outs:
    - {path: data/clips/diverse, hash: md5, md5: ccc.dir, size: 1, nfiles: 1}
"""


def git(root: Path, *arguments: str) -> str:
    command = ["git", "-c", "user.name=A", "-c", "user.email=a@example.org", *arguments]
    return subprocess.run(command, cwd=root, check=True, capture_output=True, text=True).stdout.strip()


def write(root: Path, params: str, metrics: dict, lock: str, strip: bytes) -> None:
    (root / "metrics/plots").mkdir(parents=True, exist_ok=True)
    (root / "params.yaml").write_text(params)
    (root / "metrics/imitation.json").write_text(json.dumps(metrics))
    (root / "dvc.lock").write_text(lock)
    (root / "metrics/plots/strip-sim.png").write_bytes(strip)


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A repository with one commit, in a folder below its top level."""
    git(tmp_path, "init", "-q")
    root = tmp_path / "study"
    root.mkdir()
    write(root, PARAMS, METRICS, LOCK.replace("PHI", "0.3").replace("OUT", "bbb"), b"before")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-qm", "first")
    monkeypatch.chdir(root)
    return root


def run(*arguments: str) -> str:
    app = typer.Typer()
    app.command()(review)
    result = CliRunner().invoke(app, list(arguments), catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


def change_everything(root: Path) -> None:
    far = {"runs": 15, "success_rate": 0.2, "success_rate_low": 0.07, "success_rate_high": 0.45}
    lock = LOCK.replace("PHI", "1.0").replace("OUT", "ddd").replace("aaa", "eee")
    write(root, PARAMS.replace("0.3", "1.0"), {"ours": far}, lock, b"after")


def test_nothing_changed_is_said_so(project):
    output = run()
    assert "Params: unchanged" in output
    assert "Metrics: unchanged" in output
    assert "Strips: unchanged" in output
    assert "Unchanged: 2." in output


def test_each_kind_of_change_is_listed(project):
    change_everything(project)
    output = run("HEAD")
    assert "| `imitation.reward.phi` | `0.3` | `1.0` |" in output
    assert "**0.8 [0.55, 0.93]** | **0.2 [0.07, 0.45]** | **-0.6**" in output
    head = git(project, "rev-parse", "HEAD")
    assert f"`{head[:10]}:metrics/plots/strip-sim.png` | `metrics/plots/strip-sim.png`" in output
    row = "| `imitate@ours` | `imitation.reward.phi`, `src/anyview/learners/ddpg.py` | changed |"
    assert row in output
    assert "`runs`" not in output
    assert "Unchanged: 1." in output


def test_two_commits_and_links_to_pictures(project):
    before = git(project, "rev-parse", "HEAD")
    change_everything(project)
    git(project, "add", ".")
    git(project, "commit", "-qm", "second")
    after = git(project, "rev-parse", "HEAD")
    output = run("HEAD~1", "--to", "HEAD", "--images", "https://example.org/raw/")
    for sha in (before, after):
        assert f"(https://example.org/raw/{sha}/metrics/plots/strip-sim.png)" in output


def test_json_holds_the_same_changes(project):
    change_everything(project)
    values = json.loads(run("--json"))
    assert values["params"] == [{"key": "imitation.reward.phi", "before": 0.3, "after": 1.0}]
    (metric,) = values["metrics"]
    assert metric["key"] == "imitation.ours.success_rate"
    assert metric["beyond"] is True
    assert [stage["name"] for stage in values["stages"]] == ["imitate@ours"]


def test_a_state_without_results_is_no_error(project):
    for name in ("params.yaml", "dvc.lock", "metrics/imitation.json"):
        (project / name).unlink()
    output = run()
    assert "| `base.seed` | `42` | – |" in output
    assert "| `imitate@ours` | removed | changed |" in output
    assert "gone" in output


@pytest.mark.parametrize(
    ("before", "after", "beyond"),
    [
        (Reading(0.8, 0.5, 0.9), Reading(0.6, 0.3, 0.85), False),
        (Reading(0.8, 0.7, 0.9), Reading(0.6, 0.5, 0.69), True),
        (Reading(0.8, 0.7, 0.9), Reading(0.6, 0.2, 0.95), False),
        (Reading(15), Reading(3), False),
        (None, Reading(0.6, 0.5, 0.7), False),
    ],
)
def test_a_metric_is_beyond_only_outside_both_intervals(before, after, beyond):
    assert MetricChange("x", before, after).beyond is beyond


@pytest.mark.parametrize("revision", ["no-such-branch", "--output=x", "HEAD~7", ""])
def test_an_unknown_revision_is_one_clear_error(project, revision):
    with pytest.raises(AnyviewError, match="no such revision"):
        find_revision(project, revision)


def test_outside_a_repository(tmp_path):
    with pytest.raises(AnyviewError, match="not inside a Git repository"):
        find_revision(tmp_path, "HEAD")


@pytest.mark.parametrize(
    ("path", "content"),
    [
        ("metrics/imitation.json", "{"),
        ("metrics/imitation.json", '{"ours": "high"}'),
        ("metrics/imitation.json", "[1]"),
        ("params.yaml", "a: ["),
        ("params.yaml", "- 1"),
        ("dvc.lock", "stages: [1]"),
    ],
)
def test_a_broken_file_is_named(project, path, content):
    (project / path).write_text(content)
    with pytest.raises(AnyviewError, match=path):
        compare(find_revision(project, "HEAD"), Revision(project))
