"""Figure 20 with several translators of each loss, at the `smoke` profile, by the real DVC."""

import pytest

from anyview.config import load_params
from tests.conftest import Study

pytestmark = pytest.mark.slow

STUDY = ("dvc", "repro", "check", "simulate@diverse", "split@diverse")


@pytest.fixture(scope="module")
def evidence(trunk, tmp_path_factory) -> Study:
    """The trunk's repository, seen from evidence/."""
    study = trunk.copy(tmp_path_factory.mktemp("evidence"))
    study.run(*STUDY)
    return Study(study.folder / "evidence", study.scratch)


def test_dvc_plans_every_translator_seed_and_reward(evidence):
    params = load_params(evidence.folder / "params.yaml").evidence
    cells = [f"{name}-{seed}" for name in params.translators for seed in params.seeds]
    said = evidence.run(
        "dvc", "repro", "--dry", "train"
    )  # with `imitate` it asks for the translators' folders
    assert all(f"> python train.py {' '.join(cell.rsplit('-', 1))}\n" in said for cell in cells)
    stages = evidence.run("dvc", "stage", "list", "--name-only").split()
    expected = {f"train@{cell}" for cell in cells}
    assert set(stages) == expected | {
        f"imitate@{cell}-{reward}" for cell in cells for reward in params.rewards
    }


def test_one_translator_runs_under_one_reward_and_the_study_does_not_see_it(evidence):
    evidence.run("dvc", "repro", "imitate@sim-no-alignment-2-raw")
    assert (evidence.folder / "data/models/sim-no-alignment-seed-2/weights.safetensors").is_file()
    assert (evidence.folder / "data/policies/sim-no-alignment-seed-2-raw/runs.csv").is_file()
    assert "didn't change" in evidence.run("dvc", "repro", "imitate@sim-no-alignment-2-raw")
    study = Study(evidence.folder.parent, evidence.scratch)
    assert not list((study.folder / "data/models").glob("*-seed-*"))
    assert "-seed-" not in study.run("dvc", "status")
    assert study.run("git", "status", "--porcelain", "evidence").split() == ["??", "evidence/dvc.lock"]


def test_translators_of_two_seeds_differ(evidence):
    for translator, seed in (("sim", 1), ("sim", 2)):
        evidence.run("dvc", "repro", f"train@{translator}-{seed}")
    weights = [
        (evidence.folder / f"data/models/sim-seed-{seed}/weights.safetensors").read_bytes() for seed in (1, 2)
    ]
    assert weights[0] != weights[1]


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (("train.py",), "usage: python train.py TRANSLATOR, where TRANSLATOR is one of sim, "),
        (("train.py", "sim", "7"), "usage: python train.py TRANSLATOR SEED, where SEED is one of 1, 2"),
        (("imitate.py", "sim", "1", "plain"), "where REWARD is one of normalised, raw"),
        (("report.py", "all"), "usage: python report.py"),
    ],
)
def test_wrong_arguments_are_told_in_a_line(evidence, command, said):
    process = evidence.start("python", *command)
    _, complaint = process.communicate()
    assert process.returncode == 2
    assert said in complaint
    assert len(complaint.splitlines()) == 1


def test_the_whole_of_it_is_reported(evidence):
    """Two translators of two seeds, so as to take no longer: what is not there yet is left out."""
    for name in ("sim", "sim-no-alignment"):
        for seed in (1, 2):
            evidence.run("dvc", "repro", f"imitate@{name}-{seed}-raw")
    evidence.run("python", "report.py")
    results = evidence.folder / "results"
    text = (results / "results.md").read_text(encoding="utf-8")
    assert "| raw | without L_align | open |" in text
    assert "normalised |" not in text
    assert {path.name for path in results.iterdir()} == {
        "rates.csv",
        "ablations.csv",
        "learning.csv",
        "success.svg",
        "learning.svg",
        "results.md",
    }
