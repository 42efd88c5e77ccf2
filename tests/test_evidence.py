"""Several models of each kind, at the `smoke` profile by the real DVC; and the pages, of invented results."""

import json
import re
import shutil
import subprocess
import sys
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from anyview import paths
from anyview.config import load_params
from tests.conftest import ROOT, Study
from tests.long_stages import digests
from tests.stage_outputs import Data

STUDY = ("dvc", "repro", "check", "simulate@diverse", "split@diverse")


@pytest.fixture(scope="module")
def evidence(trunk, tmp_path_factory) -> Study:
    """The trunk's repository, seen from evidence/."""
    study = trunk.copy(tmp_path_factory.mktemp("evidence"))
    study.run(*STUDY)
    return Study(study.folder / "evidence", study.scratch)


@pytest.mark.slow
def test_dvc_plans_every_translator_seed_and_reward(evidence):
    params = load_params(evidence.folder / "params.yaml").evidence.losses
    cells = [f"{name}-{seed}" for name in params.translators for seed in params.seeds]
    # With `losses-imitate` it asks for the translators' folders.
    said = evidence.run("dvc", "repro", "--dry", "losses-train")
    assert all(f"> python losses/train.py {' '.join(cell.rsplit('-', 1))}\n" in said for cell in cells)
    stages = evidence.run("dvc", "stage", "list", "--name-only").split()
    expected = {f"losses-train@{cell}" for cell in cells}
    expected |= {f"losses-imitate@{cell}-{reward}" for cell in cells for reward in params.rewards}
    expected |= {
        f"losses-imitate-others@{name}-{seed}-{reward}"
        for name in params.translators
        for seed in params.others.seeds
        for reward in params.others.rewards
    }
    assert {stage for stage in stages if stage.startswith("losses")} == expected


@pytest.mark.slow
def test_one_translator_runs_under_one_reward_and_the_study_does_not_see_it(evidence):
    evidence.run("dvc", "repro", "losses-imitate@sim-no-alignment-2-raw")
    assert (evidence.folder / "data/models/sim-no-alignment-seed-2/weights.safetensors").is_file()
    assert (evidence.folder / "data/policies/sim-no-alignment-seed-2-raw/runs.csv").is_file()
    assert "didn't change" in evidence.run("dvc", "repro", "losses-imitate@sim-no-alignment-2-raw")
    study = Study(evidence.folder.parent, evidence.scratch)
    assert not list((study.folder / "data/models").glob("*-seed-*"))
    assert "-seed-" not in study.run("dvc", "status")
    assert study.run("git", "status", "--porcelain", "evidence").split() == ["??", "evidence/dvc.lock"]


@pytest.mark.slow
def test_translators_of_two_seeds_differ(evidence):
    for seed in ("1", "2"):
        evidence.run("python", "losses/train.py", "sim", seed)
    weights = [
        (evidence.folder / f"data/models/sim-seed-{seed}/weights.safetensors").read_bytes() for seed in (1, 2)
    ]
    assert weights[0] != weights[1]


@pytest.mark.slow
def test_a_set_of_every_view_with_distractors_is_the_diverse_one(evidence):
    evidence.run("python", "diversity/simulate.py", "any", "distractors")
    made, diverse = (
        digests(evidence.folder / "data/clips" / name) for name in ("views-any-distractors", "diverse")
    )
    assert made == {name: digest for name, digest in diverse.items() if name != "summary.json"}


@pytest.mark.slow
def test_a_translator_of_one_view_is_evaluated_in_it_and_reported(evidence):
    evidence.run("dvc", "repro", "diversity-imitate@1-plain-16-1-own")
    name = "views-1-plain-16-seed-1"
    description = json.loads((evidence.folder / f"data/policies/{name}-own/policy.json").read_text())
    contexts = [(context["azimuth"], context["distractors"]) for context in description["contexts"]]
    assert contexts == [(0.0, [])] * len(contexts)
    shown = pd.read_csv(evidence.folder / f"data/policies/{name}-own/demonstrations.csv")["clip"]
    split = pd.read_csv(evidence.folder / "data/splits/diverse.csv").set_index("clip")["split"]
    assert set(split[shown]) == {"validation"}
    evidence.run("python", "report.py")
    page = (evidence.folder / "results/diversity/results.md").read_text()
    assert "1 of 16 evaluations are there" in page
    assert "No two cells can be compared yet" in page


@pytest.mark.slow
def test_a_method_with_one_of_several_embeddings_runs(evidence):
    evidence.run("dvc", "repro", "headline-imitate-embedded@tcn-2")
    assert (evidence.folder / "data/policies/headline-tcn-seed-2/runs.csv").is_file()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "said"),
    [
        (("losses/train.py",), "usage: python losses/train.py TRANSLATOR, where TRANSLATOR is one of sim, "),
        (
            ("losses/train.py", "sim", "7"),
            "python losses/train.py TRANSLATOR SEED, where SEED is one of 1, 2",
        ),
        (("losses/imitate.py", "sim", "1", "plain"), "where REWARD is one of normalised, raw"),
        (("diversity/train.py", "any", "plain", "17"), "where DEMONSTRATIONS is one of 16, 24"),
        (("report.py", "all"), "usage: python report.py"),
    ],
)
def test_wrong_arguments_are_told_in_a_line(evidence, command, said):
    process = evidence.start("python", *command)
    _, complaint = process.communicate()
    assert process.returncode == 2
    assert said in complaint
    assert len(complaint.splitlines()) == 1


def report(root: Path) -> subprocess.CompletedProcess:
    """Run evidence/report.py in ``root``, with the repository's own params."""
    shutil.copy(ROOT / "params.yaml", root)
    command = [sys.executable, ROOT / "evidence/report.py"]
    return subprocess.run(command, cwd=root, capture_output=True, text=True)


def write_set(root: Path, name: str, azimuths: np.ndarray) -> None:
    """A set's tables: of ten clips the last one is held out."""
    clips = [f"diverse-{index:04d}" for index in range(len(azimuths))]
    contexts = [json.dumps({"azimuth": azimuth}) for azimuth in azimuths]
    folder = root / paths.clip_set(name)
    folder.mkdir(parents=True)
    pd.DataFrame({"clip": clips, "context": contexts}).to_csv(folder / "manifest.csv", index=False)
    split = np.where(np.arange(len(azimuths)) % 10 == 9, "validation", "train")
    (root / paths.split_table(name)).parent.mkdir(parents=True, exist_ok=True)
    table = pd.DataFrame({"clip": clips, "pair": clips, "split": split})
    table.to_csv(root / paths.split_table(name), index=False)


def test_every_part_has_a_page_with_its_verdicts(tmp_path):
    """One view alone ends far away, all else is alike; without L_tr it ends farther, without L_align not."""
    evidence, data = load_params(ROOT / "params.yaml").evidence, Data(tmp_path)
    last = evidence.losses.iterations
    for name, metres in (("sim", 0.03), ("sim-no-translation", 0.4), ("sim-no-alignment", 0.03)):
        for seed in evidence.losses.seeds:
            for reward in evidence.losses.rewards:
                data.policies(paths.replicate(name, seed, reward), metres, last=last)
    for views, clutter in product((1, 4, "any"), paths.CLUTTER):
        name = paths.restricted_set(str(views), clutter)
        apart = 360 if views == "any" else views
        write_set(tmp_path, name, 2 * np.pi * (np.arange(4000) % apart) / apart)
        for seed, count in product(evidence.diversity.seeds, (250, 4000)):
            policies = paths.replicate(f"{name}-{count}", seed, "diverse")
            data.policies(policies, 0.3 if views == 1 else 0.03, last=evidence.diversity.iterations)
            contexts = [{"azimuth": azimuth} for azimuth in np.linspace(0, np.pi, 15)]
            (tmp_path / paths.policies(policies) / "policy.json").write_text(
                json.dumps({"contexts": contexts})
            )
    for name, seed in product(("ours", "oracle"), evidence.headline.seeds):
        metres = {"ours": 0.03, "oracle": 0.01}[name]
        data.policies(paths.replicate(paths.headline(name), seed), metres, last=evidence.headline.iterations)

    done = report(tmp_path)
    assert done.returncode == 0, done.stderr
    pages = {part: (tmp_path / f"results/{part}/results.md").read_text() for part in paths_of(tmp_path)}
    assert set(pages) == {"losses", "diversity", "headline"}
    assert re.search(
        r"\| without L_tr \| -33.3% \| raw \| [\d.]+%, [\d.]+% \|( supported \|){3}\n", pages["losses"]
    )
    assert "| without L_align | -6.67% | normalised | – | open | open | open |" in pages["losses"]
    shares = pd.read_csv(tmp_path / "results/losses/shares.csv").set_index(["reward", "cell"])["share"]
    assert shares["raw", "no-alignment"] == pytest.approx(0.5, rel=0.02)  # both rewards are invented alike
    assert (
        "- viewpoints, in any context by any clip: 1 is worse than any; 4 ends open, " in pages["diversity"]
    )
    assert "none is seen to be worse than distractors; plain ends " in pages["diversity"]
    assert "24 of 96 evaluations are there" in pages["diversity"]
    assert "| 1 | 90 to 180 | 7 | 56 |" in pages["diversity"]
    assert "| Oracle (true view) | 0." in pages["headline"]
    for part, text in pages.items():
        assert "nan" not in text.lower(), part
        assert "None" not in text, part
    angles = pd.read_csv(tmp_path / "results/diversity/angles.csv").set_index("views")
    assert angles.loc["4", "most"].max() == 45
    assert angles.loc["any", "most"] == 22.5


def paths_of(root: Path) -> list[str]:
    """The parts that have a page."""
    return [page.parent.name for page in root.glob("results/*/results.md")]


def test_with_nothing_to_report_on_it_says_so(tmp_path):
    done = report(tmp_path)
    assert done.returncode == 2
    assert (
        done.stderr == "error: data: nothing of the evidence is evaluated yet, or not with all of its seeds\n"
    )
