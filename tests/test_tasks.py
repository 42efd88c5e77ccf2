"""Tasks by name: their clips from the manifest alone, one from outside the package, names that are none."""

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

from anyview.pusher.contexts import Context, sample_contexts
from anyview.pusher.expert import roll_out
from anyview.pusher.render import renderer
from anyview.pusher.task import load_task, task_names
from anyview.runtime.errors import AnyviewError
from anyview.video.files import read_video
from anyview.video.sets import open_frames


def run(root: Path, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python in ``folder``, where modules can be imported from."""
    path = f"{root / 'src'}{os.pathsep}{folder}"
    environment = os.environ | {"PYTHONPATH": path, "ANYVIEW_WORKERS": "1"}
    return subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, text=True
    )


def stage(root: Path, folder: Path, name: str, cell: str) -> subprocess.CompletedProcess[str]:
    """Run the script in ``folder`` that a stage of beyond/dvc.yaml runs."""
    script = "beyond/train.py" if name == "train" else f"stages/{name}.py"
    return run(root, folder, str(root / script), cell)


def small_study(root: Path, folder: Path, *tasks: str) -> None:
    """Params with a few demonstrations of ``tasks`` at 32 pixels, and tiny trainings on them."""
    yaml = YAML()
    params = yaml.load((root / "params.yaml").read_text())
    params["sim"]["image_size"] = 32
    params["training"] |= {"batch_size": 4, "validation_every": 1, "validation_pairs": 8}
    params["imitation"] |= {"runs": 2, "iterations": 2}
    params["imitation"]["ddpg"] |= {
        "warmup_episodes": 1,
        "updates_per_step": 0.1,
        "hidden": [8],
        "batch_size": 8,
    }
    beyond = params["beyond"]
    for task in tasks:
        beyond["sets"][task] = {"task": task, "contexts": "diverse", "demos": 6}
        beyond["split"][task] = {"validation": 2}
        translator = beyond["translators"]["sim-reach"] | {"dataset": task, "experts": task, "iterations": 2}
        beyond["translators"][f"sim-{task}"] = translator | {
            "pretraining": {"dataset": task, "iterations": 0}
        }
        cell = beyond["cells"]["reach"] | {"dataset": task, "experts": task, "model": f"sim-{task}"}
        cell |= {"demonstrations": 2, "runs": None}
        beyond["cells"][task] = cell
    with (folder / "params.yaml").open("w") as handle:
        yaml.dump(params, handle)


@pytest.mark.parametrize("task", ["reach", "strike", "sweep"])
def test_a_set_can_be_rendered_again_from_its_manifest(root: Path, tmp_path: Path, monkeypatch, task: str):
    small_study(root, tmp_path, task)
    done = stage(root, tmp_path, "simulate", task)
    assert done.returncode == 0, done.stderr
    monkeypatch.chdir(tmp_path)
    store = open_frames(Path("data/clips") / task)
    contexts = [Context.from_json(text) for text in store.manifest["context"]]
    assert {context.task for context in contexts} == {task}
    positions, distances = roll_out(contexts)
    camera = renderer(task, 32)
    for frames, context, path in zip(store.frames, contexts, positions, strict=True):
        np.testing.assert_array_equal(camera.render_clip(context, path), frames)
    np.testing.assert_array_equal(store.manifest["final_distance"].astype(float), distances)
    assert (distances < load_task(task).tolerance).all()


@pytest.fixture(scope="module")
def outside(root: Path, tmp_path_factory) -> Path:
    """A folder with the task of docs/extending.md, which the package does not have, and a study of it."""
    folder = tmp_path_factory.mktemp("outside")
    text = (root / "docs/extending.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"^```python\n(.*?)^```", text, re.M | re.S)
    (folder / "anyview_between.py").write_text(code)
    small_study(root, folder, "between")
    return folder


def test_a_task_from_outside_goes_through_every_stage(root: Path, outside: Path) -> None:
    for command in (
        ("simulate", "between"),
        ("split", "between"),
        ("train", "sim-between"),
        ("translate", "sim-between"),
        ("imitate", "between"),
    ):
        done = stage(root, outside, *command)
        assert done.returncode == 0, done.stderr
    summary = json.loads((outside / "data/clips/between/summary.json").read_text())
    assert summary["expert_success"] == 1
    runs = pd.read_csv(outside / "data/policies/between/runs.csv")
    assert len(runs) == 2
    policies = json.loads((outside / "data/policies/between/policy.json").read_text())
    assert {context["task"] for context in policies["contexts"]} == {"between"}


def test_a_task_from_outside_is_an_environment(root: Path, outside: Path) -> None:
    code = """
import gymnasium, anyview, numpy as np
from gymnasium.utils.env_checker import check_env
env = gymnasium.make("anyview/Pusher3DoF-v0", task="between", render_mode="rgb_array")
check_env(env.unwrapped)
env.reset(seed=1)
for _ in range(49):
    *_, truncated, info = env.step(np.zeros(3, np.float32))
print(truncated, info["distance"] > 0.03)
"""
    done = run(root, outside, "-c", code)
    assert done.stdout == "True True\n", done.stderr


def test_a_task_from_outside_can_be_tried(root: Path, outside: Path) -> None:
    done = run(root, outside, str(root / "examples/try_task.py"), "between")
    assert done.stdout.startswith("the expert solves 1000 of 1000 contexts, "), done.stderr
    assert read_video(outside / "between.avi").shape == (50, 32, 6 * 32, 3)


def test_a_name_that_is_no_task_is_refused(root: Path, outside: Path, monkeypatch) -> None:
    known = ", ".join(task_names())
    assert {"push", "reach", "strike", "sweep"} <= set(task_names())
    with pytest.raises(AnyviewError, match=f"task raech: no such module; there are {known}, and"):
        load_task("raech")
    (outside / "anyview_hollow.py").write_text("TASK = 'mine'\n")
    monkeypatch.syspath_prepend(outside)
    with pytest.raises(
        AnyviewError, match=r"task hollow: .*anyview_hollow.py has no TASK, an instance of Task"
    ):
        load_task("hollow")
    (outside / "anyview_half.py").write_text(
        "from anyview.pusher.task import Task\n"
        "class Half(Task):\n"
        "    goal_radius = 0.1\n"
        "    propose = expert_poses = distance = None\n"
        "TASK = Half()\n"
    )
    with pytest.raises(AnyviewError, match=r"half: .*anyview_half.py: TASK lacks tolerance, tool, objects"):
        load_task("half")
    for name in ("json", "push.numpy", "", "../push"):
        with pytest.raises(AnyviewError, match="no such module"):
            load_task(name)
    with pytest.raises(AnyviewError, match=r"task raech: no such module"):
        sample_contexts(np.random.default_rng(0), 1, task="raech")
    params = (outside / "params.yaml").read_text()
    (outside / "params.yaml").write_text(params.replace("task: between", "task: betwixt"))
    done = stage(root, outside, "simulate", "between")
    (outside / "params.yaml").write_text(params)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert done.stderr.startswith(f"error: task betwixt: no such module; there are {known}, ")
