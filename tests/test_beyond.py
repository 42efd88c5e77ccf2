"""What goes beyond the thesis, at the `smoke` profile, by the real DVC in its own repository."""

import json

import numpy as np
import pandas as pd
import pytest

from anyview.config import load_params
from anyview.learners.common.policies import load_policy
from anyview.pusher.contexts import Context
from anyview.pusher.expert import roll_out
from anyview.pusher.render import renderer
from anyview.video.sets import open_frames
from tests.conftest import Study

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def beyond(trunk, tmp_path_factory) -> Study:
    """The whole of beyond/ on top of the trunk."""
    study = trunk.copy(tmp_path_factory.mktemp("beyond"))
    study.run("dvc", "repro", "split@real", "split@rendered", "embed@tcn")
    study = Study(study.folder / "beyond", study.scratch)
    study.run("dvc", "repro")
    return study


def test_the_second_run_has_nothing_to_do_and_the_study_does_not_see_the_first(beyond):
    assert "Data and pipelines are up to date." in beyond.run("dvc", "repro")
    study = Study(beyond.folder.parent, beyond.scratch)
    assert "choice" not in study.run("dvc", "status")
    said = study.run("git", "status", "--porcelain", "beyond")
    changed = {line[3:].removesuffix("beyond.json") for line in said.splitlines()}
    assert changed == {"beyond/dvc.lock", "beyond/metrics/"}


def test_metrics_and_page_tell_of_every_cell(beyond):
    cells = load_params(beyond.folder / "params.yaml").beyond.cells
    metrics = json.loads((beyond.folder / "metrics/beyond.json").read_text())
    page = (beyond.folder / "data/beyond/index.html").read_text(encoding="utf-8")
    for cell in cells:
        assert f'"{cell}"' in json.dumps(metrics), cell
    assert page.count("<img") >= 2
    assert (beyond.folder / "data/beyond/figures/clip-decides.webp").read_bytes()[8:12] == b"WEBP"


def test_a_robot_imitates_held_out_clips_of_a_hand(beyond):
    shown, theirs = (
        pd.read_csv(beyond.folder / f"data/policies/{cell}/demonstrations.csv")["clip"]
        for cell in ("human", "human-xirl")
    )
    assert list(shown) == list(theirs)
    split = pd.read_csv(beyond.folder / "data/splits/real.csv").set_index("clip")["split"]
    assert set(split[shown]) == {"validation"}
    translated = pd.read_csv(beyond.folder / "data/translations/sim-human/clips.csv")
    assert set(split[translated["source"]]) == {"validation"}
    assert translated["clip"].str.startswith("diverse").all()


def test_clips_of_a_tempo_of_their_own_are_what_their_manifest_tells(beyond):
    folder = beyond.folder / "data/clips/tempo"
    store = open_frames(folder)
    contexts = [Context.from_json(text) for text in store.manifest["context"][:3]]
    progress = np.array([text.split() for text in store.manifest["progress"][:3]], float)
    positions, distances = roll_out(contexts, progress)
    camera = renderer("push", store.frames.shape[2])
    for row, scene in enumerate(zip(contexts, positions, strict=True)):
        assert np.array_equal(store.frames[row], camera.render_clip(*scene))
    assert list(distances) == list(store.manifest["final_distance"][:3])
    assert store.manifest["progress"].nunique() == len(store.manifest)


def test_each_context_is_run_for_both_goals_and_no_evaluation_sees_tuning_contexts(beyond):
    folder = beyond.folder / "data/policies"
    for cell in ("choice", "choice-one-clip", "choice-clock"):
        runs = pd.read_csv(folder / cell / "runs.csv")
        assert list(runs["context"]) == [0, 1, 0, 1]
        assert list(runs["choice"]) == ["red", "red", "green", "green"]
        first, second = (load_policy(folder / cell, run).context for run in (0, 2))
        assert first.choosing("green") == second
    contexts = {
        cell: load_policy(folder / cell, 0).context for cell in ("ours", "clock", "clips-1", "clips-20")
    }
    assert contexts["ours"] == contexts["clock"] != contexts["clips-1"] == contexts["clips-20"]
