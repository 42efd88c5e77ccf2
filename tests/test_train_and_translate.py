"""The stages `train` and `translate`, as DVC runs them."""

import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
from ruamel.yaml import YAML


def run(*command: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *map(str, command)], capture_output=True, text=True)


@pytest.fixture
def study(pipeline, root) -> Path:
    """The pipeline's folder with small params."""
    yaml = YAML()
    params = yaml.load(root / "params.yaml")
    params["training"] |= {"batch_size": 10, "validation_every": 5, "validation_pairs": 20}
    params["assessment"] |= {"clips": 5, "shown": 2, "permutations": 3}
    params["translators"]["sim"]["iterations"] = 10
    yaml.dump(params, pipeline / "params.yaml")
    return pipeline


def test_train_then_translate(study, root):
    trained = run(root / "stages/train.py", "sim")
    assert trained.returncode == 0, trained.stderr
    assert "10/10" in trained.stdout
    assert "samples/s" in trained.stdout
    translated = run(root / "stages/translate.py", "sim")
    assert translated.returncode == 0, translated.stderr
    assert len(pd.read_csv("data/translations/sim/clips.csv")) == 5
    assert len(list(Path("data/translations/sim/clips").glob("*.avi"))) == 2


@pytest.mark.parametrize(
    ("command", "complaint"),
    [
        (["train", "sam"], "usage"),
        (["train", "sim", "real"], "usage"),
        (["translate", "sim"], "data/models/sim"),
    ],
)
def test_stages_refuse_what_cannot_be(study, root, command, complaint):
    ended = run(root / f"stages/{command[0]}.py", *command[1:])
    assert_refused(ended, complaint)


def assert_refused(ended: subprocess.CompletedProcess[str], complaint: str) -> None:
    """One line on standard error, no traceback, exit code 2."""
    assert ended.returncode == 2, ended.stderr
    assert ended.stderr.startswith("error: ")
    assert ended.stderr.count("\n") == 1
    assert complaint in ended.stderr
