"""`anyview review` against real Git repositories."""

import json
import re
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from anyview.cli.review import review
from anyview.review.changes import Change, compare
from anyview.review.results import Measurement
from anyview.review.revisions import Revision, find_revision
from anyview.runtime.errors import AnyviewError
from tests.review import commands

PARAMS = "base: {seed: 42}\nimitation:\n  ddpg: {discount: 0.3}\n"
METRICS = {"ours": {"runs": 15, "success_rate": 0.8, "success_rate_low": 0.55, "success_rate_high": 0.93}}
LOCK = """schema: '2.0'
stages:
  imitate@ours:
    cmd: python stages/imitate.py ours
    deps:
    - {path: src/anyview/learners/ddpg.py, hash: md5, md5: aaa, size: 1}
    params:
      params.yaml:
        imitation.ddpg: {discount: DISCOUNT}
    outs:
    - {path: data/policies/ours, hash: md5, md5: OUT.dir, size: 1, nfiles: 1}
  simulate@diverse:
    cmd: python stages/simulate.py diverse
    outs:
    - {path: data/clips/diverse, hash: md5, md5: ccc.dir, size: 1, nfiles: 1}
"""


def git(root: Path, *arguments: str) -> str:
    return commands.run(root, "git", *arguments).strip()


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
    write(root, PARAMS, METRICS, LOCK.replace("DISCOUNT", "0.3").replace("OUT", "bbb"), b"before")
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
    lock = LOCK.replace("DISCOUNT", "1.0").replace("OUT", "ddd").replace("aaa", "eee")
    write(root, PARAMS.replace("0.3", "1.0"), {"ours": far}, lock, b"after")


def test_nothing_changed_is_said_so(project):
    assert run().splitlines()[1:] == [
        "",
        "Changed: params 0, metrics 0, pictures 0. Stages: 0 ran again, 2 did not.",
    ]


def in_sight(output: str) -> list[str]:
    """The lines that a reader sees before unfolding anything."""
    return re.sub("<details>(<summary>[^<]*</summary>).*?</details>", r"\1", output, flags=re.S).splitlines()


def test_what_moved_beyond_its_interval_is_in_sight_and_the_rest_folded(project):
    change_everything(project)
    output = run("HEAD")
    assert in_sight(output)[2:] == [
        "Changed: params 1, metrics 1, pictures 1. Stages: 1 ran again, 1 did not.",
        "",
        "**Metrics that moved beyond their 95% intervals: 1.** Each value lies outside the other's interval.",
        "",
        "| metric | before | after | change |",
        "| --- | --- | --- | --- |",
        "| `imitation.ours.success_rate` | 0.8 [0.55, 0.93] | 0.2 [0.07, 0.45] | -0.6 |",
        "",
        "<summary>Params (1)</summary>",
        "<summary>Pictures (1)</summary>",
        "<summary>Stages that ran again (1)</summary>",
    ]
    assert "| `imitation.ddpg.discount` | `0.3` | `1.0` |" in output
    head = git(project, "rev-parse", "HEAD")
    assert f"| `{head[:10]}:metrics/plots/strip-sim.png` | `metrics/plots/strip-sim.png` |" in output
    row = "| `imitate@ours` | `imitation.ddpg.discount`, `src/anyview/learners/ddpg.py` | changed |"
    assert row in output


def estimates(scale: float, *names: str) -> dict[str, float]:
    return {
        name + end: scale * factor
        for name in names
        for end, factor in (("", 1), ("_low", 0.9), ("_high", 1.1))
    }


def test_a_review_of_the_study_is_a_screenful_when_all_of_it_changed(project):
    """Fourteen methods and ten translators, every metric of each far beyond its interval."""
    for scale in (1.0, 2.0):
        write(project, PARAMS.replace("0.3", str(scale)), {}, LOCK.replace("OUT", str(scale)), b"%f" % scale)
        returns = ("return_policy", "return_still", "return_arm_only", "return_expert")
        method = estimates(scale, "success_rate", "final_distance_median", *returns)
        losses = estimates(scale, "loss", "translation", "reconstruction", "alignment", "psnr", "ssim")
        for name, values in (
            ("imitation", {f"method-{index}": method for index in range(14)}),
            (
                "translation",
                {f"cell-{index}": {"validation": losses, "extreme": losses} for index in range(10)},
            ),
            ("data", {"sim": estimates(scale, "acceptance") | {"demos": scale}}),
            ("summary", {"success_percent": {f"method-{index}": 100 * scale for index in range(14)}}),
        ):
            (project / f"metrics/{name}.json").write_text(json.dumps(values))
        if scale == 1:
            git(project, "add", ".")
            git(project, "commit", "-qm", "study")
    output = run("HEAD")
    changed = 14 * 6 + 10 * 12 + 2
    assert f"metrics {changed}, pictures 1." in output
    assert f"**Metrics that moved beyond their 95% intervals: {changed - 1}.**" in output
    assert len(output.splitlines()) > changed
    seen = in_sight(output)
    assert len(seen) <= 60
    for name in ("success_rate", "final_distance_median"):
        assert sum(f".{name}`" in line for line in seen) == 14
    assert sum(".validation.loss`" in line for line in seen) == 10
    assert "| `imitation.method-13.return_expert` | 1 [0.9, 1.1] | 2 [1.8, 2.2] | +1 |" in output


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
    assert values["params"] == [{"key": "imitation.ddpg.discount", "before": 0.3, "after": 1.0}]
    (metric,) = values["metrics"]
    assert metric["key"] == "imitation.ours.success_rate"
    assert metric["beyond_intervals"] is True
    assert metric["after"] == {"value": 0.2, "low": 0.07, "high": 0.45}
    assert [picture["key"] for picture in values["pictures"]] == ["metrics/plots/strip-sim.png"]
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
        (Measurement(0.8, 0.5, 0.9), Measurement(0.6, 0.3, 0.85), False),
        (Measurement(0.8, 0.7, 0.9), Measurement(0.6, 0.5, 0.69), True),
        (Measurement(0.8, 0.7, 0.9), Measurement(0.6, 0.2, 0.95), False),
        (Measurement(15), Measurement(3), False),
        (None, Measurement(0.6, 0.5, 0.7), False),
    ],
)
def test_a_metric_is_beyond_only_outside_both_intervals(before, after, beyond):
    assert Change("x", before, after).beyond_intervals is beyond


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
