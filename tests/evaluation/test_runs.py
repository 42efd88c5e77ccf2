"""The evaluation by its real stage: same bytes for any number of workers; clear errors."""

import csv
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from ruamel.yaml import YAML

from anyview.config import load_params
from anyview.evaluation.methods import Method
from anyview.evaluation.runs import Work, evaluate_group, groups_of
from anyview.learners import ddpg
from anyview.learners.common.policies import load_policy, save_policies
from anyview.pusher.batch import PusherBatch
from anyview.pusher.contexts import sample_contexts
from anyview.rewards.cells import make_reward
from anyview.runtime.errors import AnyviewError
from anyview.seeds import stream
from anyview.translator.weights import save_translator
from anyview.video.files import read_video
from anyview.video.sets import write_set, write_shard

OURS = Method(ddpg.make_learner, make_reward)


@pytest.fixture(scope="module")
def study(tmp_path_factory, root: Path, translator, expert_clips) -> Path:
    """A folder to run the stage in: 9 runs (two groups), 3 iterations, frames of 32 pixels."""
    folder = tmp_path_factory.mktemp("study")
    yaml = YAML()
    params = yaml.load((root / "params.yaml").read_text())
    params["sim"]["image_size"] = 32
    imitation = params["imitation"]
    imitation |= {"runs": 9, "iterations": 3, "episodes_per_iteration": 1}
    imitation["demonstrations"] = 2
    imitation["ddpg"] |= {"warmup_episodes": 1, "updates_per_step": 0.2, "hidden": [16], "batch_size": 8}
    with (folder / "params.yaml").open("w") as handle:
        yaml.dump(params, handle)
    clips = [f"c{index}" for index in range(len(expert_clips))]
    (folder / "data/clips/diverse").mkdir(parents=True)
    (folder / "data/splits").mkdir()
    shard = write_shard(folder / "data/clips/diverse", 0, expert_clips)
    write_set(folder / "data/clips/diverse", pd.DataFrame({"clip": clips}), [shard])
    split = pd.DataFrame({"clip": clips, "pair": clips, "split": ["train", *["validation"] * 4]})
    split.to_csv(folder / "data/splits/diverse.csv", index=False)
    save_translator(folder / "data/models/sim", translator, {})
    return folder


def start(study: Path, root: Path, *arguments: str, **environment: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, str(root / "stages/imitate.py"), *arguments],
        cwd=study,
        env=os.environ | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_groups_are_fixed() -> None:
    assert groups_of(15, 8) == [range(8), range(8, 15)]
    assert groups_of(2, 8) == [range(2)]
    assert [len(group) for group in groups_of(15, 2)] == [2] * 7 + [1]


def test_the_stage_leaves_what_the_contract_says(study: Path, root: Path) -> None:
    process = start(study, root, "ours", ANYVIEW_WORKERS="2")
    said, complaint = process.communicate()
    assert process.returncode == 0, complaint
    assert "ours: " in said
    assert "of 9 succeed" in said
    folder = study / "data/policies/ours"
    two_workers = contents(folder)

    process = start(study, root, "ours", ANYVIEW_WORKERS="1")
    assert process.communicate()
    assert process.returncode == 0
    assert contents(folder) == two_workers

    with (folder / "runs.csv").open() as handle:
        rows = list(csv.DictReader(handle))
    assert [int(row["run"]) for row in rows] == list(range(9))
    contexts, _ = sample_contexts(stream(load_params(study / "params.yaml").base.seed, "evaluation"), 9)
    for run in (0, 8):
        # The stored policy, acted out alone, ends where the table says.
        policy = load_policy(folder, run)
        assert policy.context == contexts[run]
        pusher = PusherBatch([policy.context], policy.control, 32)
        observation = pusher.reset()[0]
        for _ in range(49):
            observation = pusher.step(policy.act(observation)[None])[0]
        assert float(rows[run]["final_distance"]) == pytest.approx(pusher.distance()[0], abs=1e-3)
        rollout = read_video(folder / "rollouts" / f"run-{run:02d}.avi")
        assert rollout.shape == (50, 32, 64, 3)
        np.testing.assert_array_equal(rollout[0, :, :32], rollout[0, :, 32:])
        np.testing.assert_array_equal(rollout[-1, :, :32], pusher.render()[0])
    curve = pd.read_csv(folder / "curve.csv")
    assert list(curve.columns) == ["iteration", "run", "final_distance", "return"]
    assert len(curve) == 27
    np.testing.assert_allclose(
        curve[curve["iteration"] == 3]["final_distance"], [float(row["final_distance"]) for row in rows]
    )


def test_watch_plays_a_policy(study: Path, root: Path) -> None:
    if not (study / "data/policies/ours").exists():
        assert start(study, root, "ours").wait() == 0
    command = [sys.executable, "-m", "anyview", "watch", "ours", "--size", "64"]
    ran = subprocess.run([*command, "--run", "8", "-o", "out.mp4"], cwd=study, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    assert "cm from the goal" in ran.stdout
    assert read_video(study / "out.mp4").shape == (50, 64, 64, 3)
    ran = subprocess.run([*command, "--run", "8", "--json"], cwd=study, capture_output=True, text=True)
    told = json.loads(ran.stdout)
    assert told["success"] == (told["final_distance"] < 0.02)
    for arguments, complaint in (
        (["--run", "9", "-o", "out.mp4"], "no run 9; there are runs 0 to 8"),
        (["-o", "out.gif"], "out.gif: the output must end in"),
    ):
        ran = subprocess.run([*command, *arguments], cwd=study, capture_output=True, text=True)
        assert ran.returncode == 2
        assert complaint in ran.stderr
        assert "Traceback" not in ran.stderr
    command[4] = "theirs"
    ran = subprocess.run(command, cwd=study, capture_output=True, text=True)
    assert ran.returncode == 2
    assert "theirs: no such method was evaluated; there are " in ran.stderr


@pytest.mark.parametrize("matching", ["steps", "transport"])
def test_an_interrupted_group_ends_with_the_same_results(
    study: Path, tmp_path: Path, expert_clips, monkeypatch, matching: str
) -> None:
    """Stop after an iteration has been kept; the second call continues, and ends where a whole one does."""
    monkeypatch.chdir(study)
    params = load_params()
    cells = {"ours": params.imitation.cells["ours"].model_copy(update={"matching": matching})}
    params = params.model_copy(update={"imitation": params.imitation.model_copy(update={"cells": cells})})
    contexts, _ = sample_contexts(stream(0, "test"), 2)
    work = Work("ours", params, OURS, [0, 1], contexts, expert_clips[:2])
    whole = evaluate_group(work, tmp_path / "whole")

    class Stop(Exception):
        pass

    from anyview.runtime.checkpoints import Checkpoints

    save = Checkpoints.save

    def save_then_stop(self: Checkpoints, step: int, *state) -> None:
        save(self, step, *state)
        if step == 2:
            raise Stop

    monkeypatch.setattr(Checkpoints, "due", lambda self: True)
    monkeypatch.setattr(Checkpoints, "save", save_then_stop)
    with pytest.raises(Stop):
        evaluate_group(work, tmp_path / "parts")
    monkeypatch.setattr(Checkpoints, "save", save)
    resumed = evaluate_group(work, tmp_path / "parts")
    pd.testing.assert_frame_equal(resumed.runs, whole.runs, check_exact=True)
    pd.testing.assert_frame_equal(resumed.curve, whole.curve, check_exact=True)
    np.testing.assert_array_equal(resumed.rollouts, whole.rollouts)
    for name, weights in whole.policies.items():
        np.testing.assert_array_equal(resumed.policies[name], weights)


def test_a_run_in_lockstep_is_the_same_run_alone(study: Path, tmp_path: Path, expert_clips, monkeypatch):
    """Through renderer, encoder, reward and the first updates; sums may differ in last digits."""
    monkeypatch.chdir(study)
    params = load_params()
    contexts, _ = sample_contexts(stream(0, "test"), 3)
    every = Work("ours", params, OURS, [0, 1, 2], contexts, expert_clips[:2])
    together = evaluate_group(every, tmp_path / "together")
    alone = evaluate_group(every._replace(runs=[1], contexts=contexts[1:2]), tmp_path / "alone")
    same = together.runs[together.runs["run"] == 1].reset_index(drop=True)
    pd.testing.assert_frame_equal(alone.runs, same, rtol=1e-4)
    for name, weights in alone.policies.items():
        np.testing.assert_allclose(weights[0], together.policies[name][1], rtol=1e-3, atol=1e-5)
        assert not np.allclose(weights[0], together.policies[name][0], rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (("imitation", "demonstrations", None, 7), "imitation.demonstrations: 7"),
        (("sim", "image_size", None, 64), "data/clips/diverse: frames of 32 pixels"),
    ],
)
def test_bad_input_is_one_clear_line(study, root, tmp_path, change, complaint: str) -> None:
    yaml = YAML()
    params = yaml.load((study / "params.yaml").read_text())
    block, key, inner, value = change
    if inner is None:
        params[block][key] = value
    else:
        params[block][key][inner] = value
    with (tmp_path / "params.yaml").open("w") as handle:
        yaml.dump(params, handle)
    (tmp_path / "data").symlink_to(study / "data")
    process = start(tmp_path, root, "ours")
    _, said = process.communicate()
    assert process.returncode == 2
    assert said.startswith("error: ")
    assert complaint in said
    assert said.count("\n") == 1


def test_damaged_policies_are_refused(tmp_path: Path) -> None:
    with pytest.raises(AnyviewError, match="no such file"):
        load_policy(tmp_path, 0)
    (tmp_path / "policy.json").write_text("{")
    with pytest.raises(AnyviewError, match="not valid JSON"):
        load_policy(tmp_path, 0)
    (tmp_path / "policy.json").write_text(json.dumps({"contexts": [1]}))
    with pytest.raises(AnyviewError, match="does not describe policies"):
        load_policy(tmp_path, 0)


@pytest.mark.parametrize(
    ("damage", "complaint"),
    [
        ({"learner": "sac"}, "learner 'sac' is none of ddpg, trpo"),
        ({"control": "warp"}, "control 'warp' is none of twist, torque"),
        ({"contexts": [1]}, "the context of run 0 is damaged"),
        ({"azimuth": 1e9}, "the context of run 0 is damaged"),
        (
            {"choice": {"colour": "red", "other_xy": [0.0, 0.0]}},
            "takes 15 inputs; in the context of run 0 there are 17",
        ),
    ],
)
def test_policies_that_fit_no_world_are_refused(tmp_path: Path, damage: dict, complaint: str) -> None:
    contexts, _ = sample_contexts(np.random.default_rng(0), 1)
    weights = {"weight0": np.zeros((1, 15, 3), np.float32), "bias0": np.zeros((1, 3), np.float32)}
    save_policies(tmp_path, weights, contexts, "trpo", "twist", 32)
    assert load_policy(tmp_path, 0).context == contexts[0]
    file = tmp_path / "policy.json"
    description = json.loads(file.read_text())
    description["contexts"][0] |= {key: damage.pop(key) for key in ("azimuth", "choice") if key in damage}
    file.write_text(json.dumps(description | damage))
    with pytest.raises(AnyviewError, match=re.escape(complaint)):
        load_policy(tmp_path, 0)
