"""`anyview imitate`, as a user runs it, with a translator that knows nothing and a handful of episodes."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
import torch
from ruamel.yaml import YAML

from anyview.cli.imitation import prepare
from anyview.learners.common.policies import load_policy
from anyview.pusher.batch import PusherBatch
from anyview.pusher.contexts import Context, sample_contexts
from anyview.pusher.episodes import film
from anyview.pusher.expert import roll_out
from anyview.pusher.render import renderer
from anyview.runtime.errors import AnyviewError
from anyview.seeds import stream
from anyview.translator.network import ContextTranslator
from anyview.translator.weights import save_translator
from anyview.video.files import read_video, write_video
from anyview.video.sets import write_clips, write_set
from tests.training.discworld import disc_clips

SIZE = 32


def start(folder: Path, *arguments: str, **environment: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "anyview", "imitate", *arguments],
        cwd=folder,
        env=os.environ | {"NO_COLOR": "1"} | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def imitate(folder: Path, *arguments: str) -> str:
    """What a good run prints."""
    process = start(folder, *arguments)
    said, complaint = process.communicate()
    assert process.returncode == 0, complaint
    return said


@pytest.fixture(scope="module")
def folder(tmp_path_factory, root: Path, translator, contexts, expert_clips) -> Path:
    """A study with two simulated sets and a translator of each, a set of other clips, and a video."""
    folder = tmp_path_factory.mktemp("imitate")
    yaml = YAML()
    params = yaml.load((root / "params.yaml").read_text())
    params["imitation"] |= {"runs": 3}
    params["imitation"]["ddpg"] |= {
        "warmup_episodes": 1,
        "updates_per_step": 0.2,
        "hidden": [16],
        "batch_size": 8,
    }
    with (folder / "params.yaml").open("w") as handle:
        yaml.dump(params, handle)
    two_goals = [
        sample_contexts(stream(0, "test"), 1, "choice")[0][0].choosing(each) for each in ("red", "green")
    ]
    chosen = filmed(two_goals)
    for name, clips, columns in (
        ("diverse", expert_clips, {}),
        ("choice", chosen, {"choice": ["red", "green"]}),
        ("real", disc_clips(2, length=60), {}),
    ):
        where = folder / "data/clips" / name
        where.mkdir(parents=True)
        manifest = pd.DataFrame({"clip": [f"{name}-{index}" for index in range(len(clips))]} | columns)
        write_set(where, manifest, [write_clips(where / "shard-0000.avi", clips, 10.0)])
    models = folder / "data/models"
    save_translator(models / "sim", translator, {"dataset": "diverse"})
    save_translator(models / "real-adam", translator, {"dataset": "real"})
    torch.manual_seed(0)
    whole_clip = ContextTranslator("compact", SIZE, task_embedding=True)
    save_translator(models / "sim-choice", whole_clip, {"dataset": "choice"})
    save_translator(folder / "framewise", translator, {"dataset": "choice"})
    slow = np.repeat(expert_clips[2], 2, axis=0).repeat(3, axis=1).repeat(3, axis=2)
    write_video(folder / "own.avi", slow, 20.0)
    write_video(folder / "short.avi", expert_clips[2][:20], 10.0)
    (folder / "text.mp4").write_text("not a video")
    return folder


def filmed(contexts: list[Context]) -> np.ndarray:
    positions, _ = roll_out(contexts)
    return np.stack(
        [renderer("push", SIZE).render_clip(*each) for each in zip(contexts, positions, strict=True)]
    )


def test_a_video_of_ones_own_becomes_a_policy(folder, expert_clips):
    said = imitate(folder, "own.avi", "--episodes", "6", "--seed", "3", "-o", "mine")
    assert "imitate: 6/6" in said
    line = said.splitlines()[-1]
    assert line.startswith("mine: the agent leaves the object ")
    policy = load_policy(folder / "mine", 0)
    # A fresh context, which is none of the study's; the stored policy ends there where the line says.
    pusher = PusherBatch([policy.context], policy.control, SIZE)
    agent = film(pusher, lambda now: policy.act(now.observations[0])[None])[0]
    distance = pusher.distance()[0]
    assert (
        f"{100 * distance:.1f} cm from the red goal: {'success' if distance < 0.02 else 'no success'}" in line
    )
    assert len(pd.read_csv(folder / "mine/curve.csv")) == 6
    video = read_video(folder / "mine/rollout.mp4")
    assert video.shape == (50, 256, 3 * 256, 3)
    # Every second frame of the clip, then its translation and the agent, which begin alike.
    small = video[:, 4::8, 4::8].astype(int)
    clip, translated, acted = np.split(small, 3, axis=2)
    assert np.abs(clip - expert_clips[2]).mean() < 6
    assert np.abs(acted - agent).mean() < 6
    assert np.abs(translated[0] - agent[0]).mean() < 6
    assert np.abs(translated[30] - agent[30]).mean() > 10
    # The same seed, the same bytes.
    again = {path.name: path.read_bytes() for path in (folder / "mine").iterdir()}
    imitate(folder, "own.avi", "--episodes", "6", "--seed", "3", "-o", "mine")
    assert {path.name: path.read_bytes() for path in (folder / "mine").iterdir()} == again


def test_what_it_does_without_being_told(folder, monkeypatch):
    """A translator of the clip's own set, a context of the seed's that is none of the study's."""
    monkeypatch.chdir(folder)
    tasks = {seed: prepare("own.avi", None, None, seed, 1, Path("mine")) for seed in (0, 0, 1)}
    assert tasks[0].model == Path("data/models/sim")
    study = sample_contexts(stream(42, "evaluation"), 3)[0]
    assert tasks[0].context != tasks[1].context
    assert not {tasks[0].context, tasks[1].context} & set(study)
    for clip, colour in (("choice-0", "red"), ("choice-1", "green")):
        task = prepare(clip, None, None, 0, 1, Path("mine"))
        assert task.model == Path("data/models/sim-choice")
        assert task.context.choice.colour == task.shown == colour


def test_a_clip_of_a_set_says_which_goal_it_shows_and_a_video_does_not(folder):
    said = imitate(folder, "choice-1", "--context", "2", "--episodes", "1", "--json", "-o", "shown")
    told = json.loads(said)
    assert (told["model"], told["shown"]) == ("data/models/sim-choice", "green")
    assert told["success"] == (told["final_distance"]["green"] < 0.02)
    study = sample_contexts(stream(42, "evaluation/choice"), 3, "choice")[0][2]
    assert load_policy(folder / "shown", 0).context == study.choosing("green")
    said = imitate(folder, "own.avi", "--model", "framewise", "--episodes", "1", "-o", "either")
    assert re.search(r"cm from the red goal and [\d.]+ cm from the green goal", said.splitlines()[-1])


@pytest.mark.parametrize(
    ("clip", "options", "complaint"),
    [
        ("text.mp4", {}, "text.mp4: not a video"),
        ("data", {}, "data: no such file"),
        ("short.avi", {}, "short.avi: 20 frames, fewer than the 50 of an episode"),
        ("real-0", {"model": "sim"}, "real-0: frames of 16 pixels, but the translator's are 32"),
        (
            "real-0",
            {},
            "data/models/real-adam: not for the simulated agent's view; train it on one of diverse, ",
        ),
        ("own.avi", {"model": "tcn"}, "data/models/tcn/model.json: no such file; train the cell first"),
        ("own.avi", {"context": 3}, "--context 3: there are contexts 0 to 2"),
        ("own.avi", {"output": Path("data")}, "data: it exists and is no earlier result"),
    ],
)
def test_bad_input_is_named(folder, monkeypatch, clip, options, complaint):
    monkeypatch.chdir(folder)
    options = {"model": None, "context": None, "output": Path("mine")} | options
    with pytest.raises(AnyviewError, match=f"^{re.escape(complaint)}"):
        prepare(clip, seed=0, episodes=5, **options)


def test_a_hands_clip_is_brought_in_step_and_to_size(folder, tmp_path, monkeypatch, translator):
    """By a translator of other experts, which comes before those that are not for the agent's view."""
    (tmp_path / "params.yaml").write_bytes((folder / "params.yaml").read_bytes())
    (tmp_path / "data").mkdir()
    (tmp_path / "data/clips").symlink_to(folder / "data/clips")
    models = tmp_path / "data/models"
    save_translator(models / "real-adam", translator, {"dataset": "real"})
    save_translator(models / "sim-human", translator, {"dataset": "diverse", "experts": "real"})
    monkeypatch.chdir(tmp_path)
    task = prepare("real-0", seed=0, episodes=5, model=None, context=None, output=Path("mine"))
    assert task.model == Path("data/models/sim-human")
    assert task.clip.shape == (50, SIZE, SIZE, 3)
    disc = disc_clips(2, length=60)[0]
    for step, frame in ((0, 4), (28, 35), (42, 51), (49, 59)):  # of 60 frames in 8 s
        there = cv2.resize(disc[frame], (SIZE, SIZE), interpolation=cv2.INTER_LINEAR)
        assert np.abs(task.clip[step].astype(int) - there).mean() < 1


def test_without_a_trained_translator_it_says_what_to_train(root, tmp_path, expert_clips):
    (tmp_path / "params.yaml").write_bytes((root / "params.yaml").read_bytes())
    write_video(tmp_path / "own.avi", expert_clips[0], 10.0)
    for clip, complaint in (
        ("own.avi", "data/models: no translator of diverse clips is trained yet (sim); run `dvc repro`"),
        ("absent.mp4", "absent.mp4: no such file, and no clip of a set in data/clips"),
    ):
        process = start(tmp_path, clip)
        said, complained = process.communicate()
        assert (process.returncode, said) == (2, "")
        assert complained.startswith(f"error: {complaint}")
        assert complained.count("\n") == 1


@pytest.mark.slow
def test_interrupted_it_leaves_nothing_and_goes_on(folder, scratch):
    """Ctrl-C after a checkpoint; the second call begins there, and ends as one that nobody stopped."""
    arguments = ("own.avi", "--episodes", "60", "-o")
    process = start(folder, *arguments, "stopped", ANYVIEW_CHECKPOINT_SECONDS="0")
    while not list(scratch.glob("checkpoints/*/checkpoint-b")):
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, complaint = process.communicate()
    assert process.returncode == 130
    assert "Traceback" not in complaint
    assert not list(folder.glob("*stopped*"))
    said = imitate(folder, *arguments, "stopped")
    assert "imitate: 60/60" in said
    imitate(folder, *arguments, "whole")
    for path in (folder / "whole").iterdir():
        assert (folder / "stopped" / path.name).read_bytes() == path.read_bytes(), path.name
    assert not list(scratch.glob("checkpoints/*/checkpoint-*"))
