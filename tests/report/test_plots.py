"""`dvc plots` on what the report writes: our declarations, our templates, through DVC itself."""

import json
import os
import shutil
import subprocess
import sys

import pandas as pd
import pytest

from anyview.analysis.results import analyse
from anyview.analysis.study import read_study
from anyview.report.plots import write_plots


@pytest.fixture(scope="module")
def shown(full, params, root, tmp_path_factory):
    """``dvc plots show --json`` of the repository's own declarations over a whole study."""
    project = tmp_path_factory.mktemp("plots")
    study = read_study(params, full)
    write_plots(project / "metrics/plots", study, analyse(study))
    (project / "metrics/live").mkdir()
    shutil.copy(root / "metrics/live/none.csv", project / "metrics/live")
    shutil.copy(root / "dvc.yaml", project)
    shutil.copy(root / "params.yaml", project)
    dvc = [sys.executable, "-m", "dvc"]
    environment = os.environ | {"DVC_NO_ANALYTICS": "1"}
    subprocess.run([*dvc, "init", "--no-scm", "-q"], cwd=project, check=True, env=environment)
    shutil.copytree(root / ".dvc/plots", project / ".dvc/plots")
    command = [*dvc, "plots", "show", "--json"]
    done = subprocess.run(command, cwd=project, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_every_declared_plot_is_drawn(shown):
    assert shown.get("errors", []) == []
    vega = {name for name, plots in shown["data"].items() if plots[0]["type"] == "vega"}
    assert vega == {
        "Success",
        "Final distance against ours",
        "Learning curves of policies",
        "Learning curves of translators",
        "Feature weights",
        "metrics/live/none.csv",
    }
    pictures = {name for name, plots in shown["data"].items() if plots[0]["type"] == "image"}
    assert {"metrics/plots/idea.png", "metrics/plots/strips/sim.png"} <= pictures


def test_plots_have_titles_axes_and_bounds(shown):
    for plots in shown["data"].values():
        if plots[0]["type"] == "vega":
            content = plots[0]["content"]
            text = content if isinstance(content, str) else json.dumps(content)
            assert "<DVC_METRIC" not in text
            assert json.loads(text)["title"]["text"]
    (success,) = shown["data"]["Success"]
    content = success["content"]
    values = (json.loads(content) if isinstance(content, str) else content)["data"]["values"]
    assert {"success_rate", "low", "high", "thesis", "method"} <= set(values[0])


def test_tables_are_thin_and_keep_their_last_point(full, params, tmp_path):
    study = read_study(params, full)
    write_plots(tmp_path, study, analyse(study))
    table = pd.read_csv(tmp_path / "final_distance.csv")
    assert table.groupby("cell").size().max() <= 101
    last = study.methods["ours"].curve["iteration"].max()
    assert table[table["cell"] == "ours"]["iteration"].max() == last
