"""The card tells of the task that it is about."""

import numpy as np
import pandas as pd
import pytest
from ruamel.yaml import YAML

from anyview.analysis.study import EvaluatedMethod
from anyview.learners.common.policies import save_policies
from anyview.pusher.batch import observation_size
from anyview.pusher.contexts import sample_contexts

pytest.importorskip("huggingface_hub")


@pytest.mark.parametrize(
    ("task", "aim", "tolerance"),
    [
        ("strike", "a ball that rolls is struck once, and comes to rest in a zone that the arm cannot", 8),
        ("sweep", "five grains are swept into a zone by a broom", 18),
    ],
)
def test_the_card_is_of_its_task(tmp_path, task: str, aim: str, tolerance: int) -> None:
    from anyview.sharing.card import write_card

    contexts, _ = sample_contexts(np.random.default_rng(0), 2, task=task)
    (tmp_path / "policies").mkdir()
    size = observation_size(task, 1)
    weights = {"weight0": np.zeros((2, size, 3), np.float32), "bias0": np.zeros((2, 3), np.float32)}
    save_policies(tmp_path / "policies", weights, contexts, "trpo", "twist", 32)
    runs = pd.DataFrame({"run": [0, 1], "success": [1, 0], "final_distance": [0.03, 0.2]})
    method = EvaluatedMethod(tmp_path / "policies", runs, pd.DataFrame(), ())
    write_card(tmp_path, "lab/theirs", "theirs", method, {}, "mit")
    _, front, text = (tmp_path / "README.md").read_text().split("---\n", 2)
    (entry,) = YAML(typ="safe").load(front)["model-index"]
    assert entry["results"][0]["dataset"] == {
        "type": f"anyview-{task}",
        "name": f"Anyview's task {task}, 2 runs",
    }
    assert f"# theirs, the task {task} imitated from video\n" in text
    assert f"for the task `{task}`: {aim}" in text
    assert f"within {tolerance} cm of the goal" in text
    assert "disc" not in text
