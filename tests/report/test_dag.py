"""The drawn pipeline: edges follow the files, cells follow the params."""

import re
import xml.etree.ElementTree as ElementTree

import pytest

from anyview.config import read_yaml
from anyview.report.dag import draw, needed_edges, read_stages
from anyview.report.text import environment
from anyview.runtime.errors import AnyviewError

TEMPLATES = environment(autoescape=True)
PARAMS = {
    "translation": {"cells": {"sim": {"dataset": "diverse"}, "tcn": {"dataset": "diverse"}}},
    "imitation": {"cells": {"ours": {"source": "data/models/sim"}, "gail": {"source": "src/gail.py"}}},
}
PIPELINE = {
    "stages": {
        "simulate": {
            "foreach": ["diverse", "narrow"],
            "do": {"cmd": "x", "desc": "film the expert", "outs": ["data/clips/${item}"]},
        },
        "split": {"cmd": "x", "deps": ["data/clips/diverse"], "outs": [{"data/splits": {"cache": False}}]},
        "train": {
            "foreach": "${translation.cells}",
            "do": {
                "cmd": "x",
                "deps": ["data/clips/${item.dataset}", "data/splits/sim.csv"],
                "outs": ["data/models/${key}"],
            },
        },
        "imitate": {
            "foreach": "${imitation.cells}",
            "do": {
                "cmd": "x",
                "deps": ["${item.source}", "data/clips/diverse"],
                "outs": ["data/policies/${key}"],
            },
        },
    }
}


def test_edges_follow_files_and_leave_out_what_longer_paths_imply():
    stages = read_stages(PIPELINE, PARAMS)
    assert needed_edges(stages) == {
        "simulate": {"split"},
        "split": {"train"},
        "train": {"imitate"},
        "imitate": set(),
    }


def test_cells_come_from_lists_and_from_params():
    cells = {stage.name: stage.cells for stage in read_stages(PIPELINE, PARAMS)}
    assert cells == {
        "simulate": ("diverse", "narrow"),
        "split": (),
        "train": ("sim", "tcn"),
        "imitate": ("ours", "gail"),
    }


def test_the_drawing_is_well_formed_and_names_every_stage():
    svg = ElementTree.fromstring(draw(read_stages(PIPELINE, PARAMS), TEMPLATES))
    words = {text.text for text in svg.iter("text")}
    assert {"simulate", "split", "train", "imitate", "2 cells", "one run"} <= words
    left, top, width, height = map(float, svg.attrib["viewBox"].split())
    for box in svg.iter("rect"):
        assert left <= float(box.attrib["x"]) <= width - float(box.attrib["width"])
        assert top <= float(box.attrib["y"]) <= height - float(box.attrib["height"])


def test_no_arrow_of_our_own_pipeline_passes_behind_a_box(root):
    """Arrows bend between rows of boxes alone, and pass a row straight down, beside its boxes."""
    pipeline, params = (read_yaml(root / name) for name in ("dvc.yaml", "params.yaml"))
    svg = ElementTree.fromstring(draw(read_stages(pipeline, params), TEMPLATES))
    boxes = [[float(box.attrib[name]) for name in ("x", "y", "width", "height")] for box in svg.iter("rect")]
    arrows = [path.attrib["d"] for path in svg.iter("path") if path.attrib.get("class") == "edge"]
    assert len(arrows) >= 8

    for arrow in arrows:
        x = y = 0.0
        for command, text in re.findall(r"([MCV])([^MCV]+)", arrow):
            numbers = [float(number) for number in text.split()]
            top, y = y, numbers[-1]
            beside = [box for box in boxes if top < box[1] + box[3] and box[1] < y]
            if command == "C":
                assert beside == []
            if command == "V":
                assert beside
                assert not any(left < x < left + width for left, _, width, _ in beside)
            else:
                x = numbers[-2]


@pytest.mark.parametrize("pipeline", [{}, [], {"stages": {"train": {"foreach": "${no.such}", "do": {}}}}])
def test_an_unreadable_pipeline_is_one_clear_error(pipeline):
    with pytest.raises(AnyviewError, match=r"dvc\.yaml"):
        read_stages(pipeline, PARAMS)


def test_a_circle_is_refused():
    circle = {
        "stages": {
            "a": {"cmd": "x", "deps": ["two"], "outs": ["one"]},
            "b": {"cmd": "x", "deps": ["one"], "outs": ["two"]},
        }
    }
    with pytest.raises(AnyviewError, match="circle"):
        draw(read_stages(circle, PARAMS), TEMPLATES)
