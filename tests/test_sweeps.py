"""Sweeps as the tutorial has them, by the real `dvc exp`, at the `smoke` profile: which stages rerun."""

import json
import shutil
import time

import pytest

from anyview.config import read_yaml
from tests.conftest import Study
from tests.long_stages import change

pytestmark = pytest.mark.slow

PHI = "imitation.cells.ours.weights.image"


@pytest.fixture(scope="module")
def study(smoke, tmp_path_factory) -> Study:
    """The smoke study, its results committed."""
    folder = tmp_path_factory.mktemp("sweep") / "study"
    shutil.copytree(smoke.folder, folder, symlinks=True, ignore=shutil.ignore_patterns("tmp", ".venv"))
    copy = Study(folder, smoke.scratch)
    for key, value in (("user.name", "A"), ("user.email", "a@example.org"), ("core.hooksPath", "/dev/null")):
        copy.run("git", "config", key, value)
    copy.run("git", "add", "-A")
    copy.run("git", "commit", "--allow-empty", "-qm", "smoke")
    return copy


def cells(study: Study, **keys: str) -> set[str]:
    """Stages of the imitation cells that have these keys in params.yaml."""
    found = read_yaml(study.folder / "params.yaml")["imitation"]["cells"]
    return {f"imitate@{name}" for name, cell in found.items() if keys.items() <= cell.items()}


def reran(study: Study) -> set[str]:
    """Stages whose entry in dvc.lock is not the committed one."""
    review = json.loads(study.run("anyview", "review", "HEAD", "--json"))
    assert review["unchanged_stages"] + len(review["stages"]) == len(
        read_yaml(study.folder / "dvc.lock")["stages"]
    )
    return {change["name"] for change in review["stages"]}


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        (PHI, 7.0, {"imitate@ours"}),
        ("adversarial.discriminator.steps", 7, {"discriminate@gail", "discriminate@tpil"}),
        (
            "imitation.trpo.step",
            0.7,
            {f"imitate@{name}" for name in ("liu", "narrow-trpo")}
            | {"discriminate@gail", "discriminate@tpil"},
        ),
    ],
)
def test_a_number_reruns_the_cells_that_read_it(study, key, value, expected):
    """By `--dry`, which names the stages without running them."""
    path = study.folder / "params.yaml"
    before = path.read_text()
    change(study.folder, {key: value})
    said = study.run("dvc", "repro", "--dry").splitlines()
    path.write_text(before)
    assert {line.split("'")[1] for line in said if line.startswith("Running stage")} == {
        "check",
        *expected,
        "report",
    }


def test_a_weight_of_a_loss_reruns_its_translator_and_what_follows(study):
    key = "translators.sim-no-alignment.weights.reconstruction"
    study.run("dvc", "exp", "run", "-S", f"{key}=0.5")
    assert reran(study) == {
        "check",
        "train@sim-no-alignment",
        "translate@sim-no-alignment",
        *cells(study, model="sim-no-alignment"),
        "report",
    }
    metric = "translation.sim-no-alignment.validation.translation"
    told = json.loads(study.run("anyview", "sweep", key, "--metric", metric, "--json"))
    assert [experiment["value"] for experiment in told["experiments"]] == [0.5, 1.0]
    study.run("git", "checkout", ".")
    study.run("dvc", "checkout")


def work_off_the_queue(study: Study) -> str:
    """Start the queue and wait for its end; its last status."""
    study.run("bash", "-c", "dvc queue start > queue.log 2>&1")
    deadline = time.monotonic() + 900
    while "Queued" in (status := study.run("dvc", "queue", "status")) or "Running" in status:
        assert time.monotonic() < deadline, status
        time.sleep(5)
    return status


def test_a_queue_of_the_whole_pipeline_runs_what_reads_phi(study):
    study.run("dvc", "exp", "run", "--queue", "-S", f"{PHI}=0.3")
    assert work_off_the_queue(study).count("Success") == 1
    told = json.loads(study.run("anyview", "sweep", PHI, "--json"))
    (found,) = (experiment["name"] for experiment in told["experiments"] if experiment["value"] == 0.3)
    study.run("dvc", "exp", "apply", found)
    assert reran(study) == {"check", "imitate@ours", "report"}
    study.run("git", "checkout", ".")
    study.run("dvc", "checkout")
    study.run("dvc", "queue", "remove", "--success")


def test_a_queue_of_one_method_and_the_report(study):
    command = ("dvc", "exp", "run", "--queue", "-S", f"{PHI}=0.01,0.1,1")
    study.run(*command, "--single-item", "imitate@ours", "report")
    status = work_off_the_queue(study)
    assert status.count("Success") == 3, status
    told = json.loads(study.run("anyview", "sweep", PHI, "--json"))
    found = {experiment["value"]: experiment["name"] for experiment in told["experiments"]}
    assert {0.01, 0.1, 1} <= found.keys()
    assert (study.folder / "sweep.svg").is_file()
    shown = study.run("dvc", "exp", "show", "--csv")
    assert all(found[value] in shown for value in (0.01, 0.1))
    study.run("dvc", "exp", "apply", found[0.01])
    assert read_yaml(study.folder / "params.yaml")["imitation"]["cells"]["ours"]["weights"]["image"] == 0.01
    assert reran(study) == {"imitate@ours", "report"}
