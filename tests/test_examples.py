"""The examples, run as their first lines say."""

import pandas as pd

from tests.long_stages import change


def test_stable_baselines3_trains_on_the_translated_reward(study):
    said = study.run("python", "examples/train_with_stable_baselines3.py", "600")
    assert "after 600 steps: " in said
    assert "cm from the goal" in said


def test_clips_are_filmed_as_ones_own_would_be(study):
    command = ["python", "examples/film_clips.py", "2", "data/raw/recorded"]
    study.run(*command)
    change(study.folder, {"real.source": "recorded"})
    study.run("python", "stages/ingest.py")
    listed = pd.read_csv(study.folder / "data/clips/real/manifest.csv")
    assert listed["pair"].value_counts().tolist() == [2, 2]
    _, complaint = (again := study.start(*command)).communicate()
    assert (again.returncode, complaint.count("\n")) == (2, 1), complaint
    assert "data/raw/recorded: is there already" in complaint
