"""`anyview sweep` on real experiments of `dvc exp` in a small project of its own."""

import json
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

from anyview.review.results import Measurement
from anyview.review.sweep_figure import sweep as draw
from anyview.review.sweeps import Experiment, Sweep, read_sweep
from anyview.runtime.errors import AnyviewError
from tests.review.commands import run

PIPELINE = """stages:
  measure:
    cmd: python measure.py
    params: [imitation, base]
    outs:
      - metrics/imitation.json: {cache: false}
"""
MEASURE = """import json, pathlib, re
text = open("params.yaml").read()
discount, seed = (float(re.search(name + r": ([\\d.]+)", text)[1]) for name in ("discount", "seed"))
values = {"success_rate": discount / 2, "success_rate_low": discount / 4, "success_rate_high": discount}
distance = {"final_distance_median": 0.1 * seed}
pathlib.Path("metrics").mkdir(exist_ok=True)
pathlib.Path("metrics/imitation.json").write_text(json.dumps({"ours": values | distance}))
"""
PARAMS = "base: {seed: 1}\nimitation:\n  ddpg: {discount: 0.3}\n"


@pytest.fixture(scope="module")
def project(tmp_path_factory) -> Path:
    """Three experiments: two that vary discount, one that varies discount and the seed."""
    folder = tmp_path_factory.mktemp("sweep")
    for name, content in (("dvc.yaml", PIPELINE), ("measure.py", MEASURE), ("params.yaml", PARAMS)):
        (folder / name).write_text(content)
    run(folder, "git", "init", "-q", "-b", "main")
    run(folder, "dvc", "init", "-q")
    run(folder, "dvc", "repro", "-q")
    run(folder, "git", "add", "-A")
    run(folder, "git", "commit", "-qm", "start")
    discount = "imitation.ddpg.discount"
    for settings in ([f"{discount}=1"], [f"{discount}=0.01"], [f"{discount}=0.1", "base.seed=2"]):
        run(folder, "dvc", "exp", "run", "-q", *(part for each in settings for part in ("-S", each)))
    run(folder, "git", "checkout", "-q", ".")
    return folder


def test_a_sweep_holds_the_experiments_that_vary_its_key_alone(project):
    sweep = read_sweep("imitation.ddpg.discount", ["imitation.ours.success_rate"], project)
    assert [experiment.value for experiment in sweep.experiments] == [0.01, 0.3, 1]
    assert [experiment.name == sweep.base for experiment in sweep.experiments] == [False, True, False]
    assert sweep.experiments[2].metrics["imitation.ours.success_rate"] == Measurement(0.5, 0.25, 1)
    assert sweep.left_out == 1


def test_the_command_prints_and_draws(project):
    printed = run(project, "anyview", "sweep", "imitation.ddpg.discount").splitlines()
    assert printed[0].split()[1:] == [
        "imitation.ddpg.discount",
        "imitation.ours.success_rate",
        "imitation.ours.final_distance_median",
    ]
    assert [line.split()[1] for line in printed[1:4]] == ["0.01", "0.3", "1"]
    assert printed[4:] == [
        "left out: 1 that vary something else too, or have no such metrics",
        "drawn: sweep.svg",
    ]
    ElementTree.parse(project / "sweep.svg")
    told = json.loads(run(project, "anyview", "sweep", "imitation.ddpg.discount", "--json", "-o", "a.png"))
    assert [experiment["value"] for experiment in told["experiments"]] == [0.01, 0.3, 1]
    assert plt.imread(project / "a.png").shape[2] == 4


@pytest.mark.parametrize(
    ("key", "metric", "complaint"),
    [
        ("imitation.ddpg.discuont", "imitation.ours.success_rate", "no such key in params.yaml"),
        ("base.seed", "imitation.ours.success_rate", "no finished experiment of this commit varies it alone"),
        ("imitation.ddpg.discount", "imitation.ours.sucess", "has imitation.ours.sucess"),
    ],
)
def test_what_cannot_be_drawn_is_told(project, key, metric, complaint):
    with pytest.raises(AnyviewError, match=complaint):
        read_sweep(key, [metric], project)


def test_outside_of_a_project(tmp_path):
    with pytest.raises(AnyviewError, match="not inside a Git repository"):
        read_sweep("base.seed", ["imitation.ours.success_rate"], tmp_path)


@pytest.mark.parametrize(
    ("values", "scale"),
    [
        ([0.0, 0.5, 1.0], "linear"),
        ([0.01, 0.1, 1.0], "symlog"),
        ([0.0, 0.01, 1.0], "symlog"),
        ([-1.0, 0.01, 1.0], "symlog"),
        (["adam", "adadelta"], "linear"),
    ],
)
def test_every_value_is_a_tick_on_a_fitting_axis(values, scale):
    name = "imitation.ours.final_distance_median"
    found = {name: Measurement(0.05, 0.03, 0.08)}
    experiments = tuple(Experiment(str(value), value, found) for value in values)
    figure = draw(Sweep("key", (name,), "", experiments, 0))
    (axis,) = figure.axes
    assert axis.get_xscale() == scale
    shown = [text.get_text() for text in axis.get_xticklabels()]
    assert shown == [f"{value:g}" if isinstance(value, float) else value for value in values]
    ticks = axis.transData.transform([(tick, 0) for tick in axis.get_xticks()])
    across = axis.transAxes.inverted().transform(ticks)[:, 0]
    assert across.min() < 0.1  # the points take up the whole panel
    assert across.max() > 0.9
    assert axis.get_ylabel() == "final distance, median (cm)"
    assert axis.get_ylim()[0] < 3 < 8 < axis.get_ylim()[1]
