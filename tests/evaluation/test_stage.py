"""The stage `imitate` where clips choose between two goals, and where every context has clips of its own."""

import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
import torch
from ruamel.yaml import YAML

from anyview.config import Params, load_params
from anyview.evaluation.demonstrations import imitated_demonstrations, own_demonstrations, rig_demonstrations
from anyview.learners.common.policies import load_policy
from anyview.pusher.contexts import COLOURS, Context, sample_contexts
from anyview.pusher.expert import roll_out
from anyview.pusher.render import renderer
from anyview.rewards.demonstration import translate_demonstrations
from anyview.runtime.errors import AnyviewError
from anyview.seeds import stream
from anyview.translator.network import ContextTranslator
from anyview.translator.weights import load_translator, save_translator
from anyview.video.files import read_video
from anyview.video.pixels import to_frames
from anyview.video.sets import open_frames, write_clips, write_set
from tests.training.discworld import clip_table, disc_clips

SIZE = 32
CLIPS = 10


@pytest.fixture(scope="module")
def study(tmp_path_factory, root: Path) -> Path:
    """Two runs of two iterations; every second clip goes to green, the first two are for training."""
    folder = tmp_path_factory.mktemp("study")
    yaml = YAML()
    params = yaml.load((root / "params.yaml").read_text())
    params["sim"]["image_size"] = SIZE
    params["imitation"] |= {"runs": 2, "iterations": 2, "episodes_per_iteration": 1}
    params["imitation"]["ddpg"] |= {
        "warmup_episodes": 1,
        "updates_per_step": 0.1,
        "hidden": [8],
        "batch_size": 8,
    }
    params["beyond"]["cells"]["choice-one-clip"]["demonstrations"] = 2
    params["beyond"]["cells"]["choice-angles"] |= {"angles": [30, 180], "runs": 3}
    with (folder / "params.yaml").open("w") as handle:
        yaml.dump(params, handle)
    contexts = sample_contexts(stream(0, "test"), CLIPS, "choice")[0]
    contexts = [context.choosing(COLOURS[index % 2]) for index, context in enumerate(contexts)]
    positions, _ = roll_out(contexts)
    clips = [renderer("push", SIZE).render_clip(*each) for each in zip(contexts, positions, strict=True)]
    names = [f"choice-{index}" for index in range(CLIPS)]
    where = folder / "data/clips/choice"
    where.mkdir(parents=True)
    stored = write_clips(where / "shard-0000.avi", np.stack(clips), 10.0)
    manifest = pd.DataFrame({"clip": names, "choice": [COLOURS[i % 2] for i in range(CLIPS)]})
    manifest["context"] = [context.to_json() for context in contexts]
    write_set(where, manifest, [stored])
    (folder / "data/splits").mkdir()
    split = ["train"] * 2 + ["validation"] * (CLIPS - 2)
    table = pd.DataFrame({"clip": names, "pair": names, "split": split})
    table.to_csv(folder / "data/splits/choice.csv", index=False)
    torch.manual_seed(0)
    save_translator(folder / "data/models/sim-choice", ContextTranslator("compact", SIZE, True), {})
    return folder


@pytest.fixture
def params(study, monkeypatch) -> Params:
    """Those of the cell whose contexts have two clips each."""
    monkeypatch.chdir(study)
    return load_params().imitating("choice-one-clip")


def test_every_context_is_run_for_each_goal_by_clips_of_its_own(study, root):
    command = [sys.executable, root / "stages/imitate.py", "choice-one-clip"]
    done = subprocess.run(command, cwd=study, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    folder = study / "data/policies/choice-one-clip"
    runs = pd.read_csv(folder / "runs.csv")
    assert list(runs["context"]) == [0, 1, 0, 1]
    assert list(runs["choice"]) == ["red", "red", "green", "green"]
    contexts = sample_contexts(stream(42, "evaluation/choice"), 2, "choice")[0]
    for row in runs.itertuples():
        assert load_policy(folder, row.run).context == contexts[row.context].choosing(row.choice)
        assert row.success == (row.final_distance < 0.02)
    shown = pd.read_csv(folder / "demonstrations.csv")
    assert shown.groupby(["choice", "context"]).size().to_dict() == {
        (c, n): 2 for c in COLOURS for n in (0, 1)
    }
    # What a run imitates is the mean translation of the clips that the table gives to it.
    store = open_frames(study / "data/clips/choice")
    model = load_translator(study / "data/models/sim-choice")
    for row in runs.itertuples():
        own = shown[(shown["choice"] == row.choice) & (shown["context"] == row.context)]["clip"]
        clips = store.frames[np.flatnonzero(store.manifest["clip"].isin(own))]
        agent, imitated = np.split(read_video(folder / f"rollouts/run-{row.run:02d}.avi"), 2, axis=2)
        _, images = translate_demonstrations(model, clips, agent[:1])
        np.testing.assert_allclose(imitated[1:].astype(int), to_frames(images)[0].astype(int), atol=1)


def test_every_context_is_run_for_each_angle_by_the_nearest_clip_of_each_goal(study, root):
    """And there are as many contexts as the cell says, not ``imitation.runs``."""
    command = [sys.executable, root / "stages/imitate.py", "choice-angles"]
    done = subprocess.run(command, cwd=study, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    folder = study / "data/policies/choice-angles"
    runs = pd.read_csv(folder / "runs.csv")
    assert list(runs["context"]) == [0, 1, 2] * 4
    assert list(runs["choice"]) == (["red"] * 3 + ["green"] * 3) * 2
    assert list(runs["angle"]) == [30] * 6 + [180] * 6
    manifest = pd.read_csv(study / "data/clips/choice/manifest.csv")[2:].set_index("clip")
    azimuths = manifest["context"].map(lambda text: Context.from_json(text).azimuth)
    shown = pd.read_csv(folder / "demonstrations.csv").set_index(["angle", "choice", "context"])["clip"]
    for row in runs.itertuples():
        context = load_policy(folder, row.run).context
        assert context.choice.colour == row.choice
        of_choice = azimuths[manifest["choice"] == row.choice]
        angles = np.degrees(np.abs(np.angle(np.exp(1j * (of_choice - context.azimuth)))))
        nearest = of_choice.index[np.abs(angles - row.angle).argmin()]
        assert shown[row.angle, row.choice, row.context] == nearest


def test_own_clips_are_held_out_ones_of_the_choice_and_fewer_are_the_first_of_more(study, params):
    manifest = pd.read_csv(study / "data/clips/choice/manifest.csv").set_index("clip")
    for colour in COLOURS:
        names, frames = own_demonstrations(params, 40, colour)
        assert frames.shape == (40, 2, 50, SIZE, SIZE, 3)
        assert set(names) == set(manifest.index[2:][manifest["choice"][2:] == colour])
        assert all(len(set(pair)) == 2 for pair in np.reshape(names, (40, 2)))
        one = params.model_copy(
            update={"imitation": params.imitation.model_copy(update={"demonstrations": 1})}
        )
        fewer = own_demonstrations(one, 40, colour)
        assert fewer.names == names[::2]
        np.testing.assert_array_equal(fewer.frames, frames[:, :1])
    shared, _ = imitated_demonstrations(params, "red")
    assert len(shared) == 2


def test_a_hands_held_out_clips_are_imitated_in_step_and_in_size(study, params):
    hand = disc_clips(6, size=24, length=80)
    table = clip_table(["train"] * 3 + ["validation"] * 3)
    folder = study / "data/clips/real"
    folder.mkdir()
    write_set(folder, table[["clip"]], [write_clips(folder / "clips.avi", hand, 10.0)])
    table.to_csv(study / "data/splits/real.csv", index=False)
    names, frames = rig_demonstrations(params, "real")
    assert len(set(names)) == 2
    assert set(names) < set(table["clip"][3:])
    assert frames.shape == (2, 50, SIZE, SIZE, 3)
    clip = hand[list(table["clip"]).index(names[0])]
    for step, frame in ((0, 5), (14, 26), (28, 47), (42, 68), (49, 79)):  # of 80 frames in 8 s
        there = cv2.resize(clip[frame], (SIZE, SIZE), interpolation=cv2.INTER_LINEAR)
        assert np.array_equal(frames[0, step], there)
    many = params.model_copy(update={"imitation": params.imitation.model_copy(update={"demonstrations": 4})})
    with pytest.raises(AnyviewError, match=r"demonstrations: 4, but data/splits/real\.csv holds out 3 clips"):
        rig_demonstrations(many, "real")


def test_too_few_clips_for_a_context_are_named(params):
    many = params.model_copy(update={"imitation": params.imitation.model_copy(update={"demonstrations": 5})})
    with pytest.raises(
        AnyviewError, match=r"imitation\.demonstrations: 5, but data/splits/choice\.csv holds out 4"
    ):
        own_demonstrations(many, 2, "red")
