"""The page's chapter on other tasks, from invented results, by the real stage."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.stage_outputs import Data

TASKS = ("reach", "strike", "sweep")


@pytest.fixture(scope="module")
def beyond(tmp_path_factory, root) -> Path:
    """A folder with the report on two methods in each task, and on `ours`."""
    data = Data(tmp_path_factory.mktemp("tasks"))
    data.policies("ours", 0.03)
    for task in TASKS:
        data.demonstrations(task)
        data.policies(f"{task}-oracle", 0.01)
        data.policies(task, 0.2)
        demonstrations = data.root / "data/policies" / task / "demonstrations.csv"
        demonstrations.write_text(f"clip\n{task}-0003\n")
    shutil.copy(root / "params.yaml", data.root)
    shutil.copy(root / "beyond/dvc.yaml", data.root)
    command = [sys.executable, root / "stages/report.py", "beyond"]
    done = subprocess.run(command, cwd=data.root, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return data.root


def test_each_task_has_its_rows_and_its_strip(beyond):
    text = (beyond / "data/beyond/report.md").read_text(encoding="utf-8")
    chapter = text[text.index("## Other tasks") :]
    for task in TASKS:
        rows = [line for line in chapter.splitlines() if line.startswith(f"| {task.capitalize()}")]
        assert len(rows) == 2
        assert all(row.count("|") == 8 for row in rows)
        assert f"### {task.capitalize()}" in chapter
    page = (beyond / "data/beyond/index.html").read_text(encoding="utf-8")
    assert page.count("<img") >= 3


def test_methods_of_other_tasks_are_not_compared_with_ours(beyond):
    tree = json.loads((beyond / "metrics/beyond.json").read_text())
    assert set(tree["tasks"]) == {name for task in TASKS for name in (task, f"{task}-oracle")}
    assert tree["tasks"]["reach"]["success_rate"] < tree["tasks"]["reach-oracle"]["success_rate"]
    assert set(tree["imitation"]) == {"ours"}
