"""The page of what goes beyond the thesis, from invented results, by its real stage."""

import json
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest

from anyview.video.sets import write_clips, write_set
from tests.report.test_page import Reader
from tests.stage_outputs import SIZE, Data, clip


def two_goals(data: Data, cell: str, distance: float) -> None:
    """Seven contexts, once for each goal."""
    data.policies(cell, distance)
    folder = data.root / "data/policies" / cell
    runs = pd.read_csv(folder / "runs.csv").iloc[:14]
    runs.insert(1, "context", runs["run"] % 7)
    runs.insert(2, "choice", np.repeat(["red", "green"], 7))
    runs["other_distance"] = 0.5
    runs.to_csv(folder / "runs.csv", index=False)
    shown = pd.DataFrame({"clip": ["choice-0003", "choice-0027"], "choice": ["red", "green"]})
    shown.to_csv(folder / "demonstrations.csv", index=False)


@pytest.fixture(scope="module")
def beyond(tmp_path_factory, params, report) -> Path:
    """The page of every cell."""
    data = Data(tmp_path_factory.mktemp("beyond"))
    data.demonstrations("choice")
    manifest = data.root / "data/clips/choice/manifest.csv"
    table = pd.read_csv(manifest)
    table.assign(choice=np.repeat(["red", "green"], 20)).to_csv(manifest, index=False)
    for cell in params.beyond.translators:
        data.translator(cell)
    data.policies("ours", 0.03)
    for index, (name, cell) in enumerate(params.beyond.cells.items()):
        make = two_goals if cell.dataset == "choice" else Data.policies
        make(data, name, 0.01 + 0.02 * index)
    hand = data.root / "data/clips/real"
    hand.mkdir()
    stored = write_clips(hand / "clips.avi", clip(80, 0, 0)[None, :, ::2, ::2], 10.0)
    write_set(hand, pd.DataFrame({"clip": ["pair-000-left"]}), [stored])
    shown = data.root / "data/policies/human/demonstrations.csv"
    pd.DataFrame({"clip": ["pair-000-left"]}).to_csv(shown, index=False)
    done = report(data.root, "beyond")
    assert done.returncode == 0, done.stderr
    return data.root


def test_the_page_stands_alone_and_has_its_chapters(beyond):
    page = Reader((beyond / "data/beyond/index.html").read_text(encoding="utf-8"))
    assert all(source.startswith("data:") for source in page.sources)
    assert {link[1:] for link in page.links if link.startswith("#")} <= set(page.ids)
    wanted = {"choice", "one-context-under-two-clips", "where-the-object-ends", "how-many-clips", "rollouts"}
    wanted |= {"from-a-humans-hand-to-a-robot", "a-hand-and-the-robot"}
    assert wanted <= set(page.ids)
    assert all(page.alternatives)


def test_tables_tell_of_every_cell(beyond, params):
    text = (beyond / "data/beyond/report.md").read_text(encoding="utf-8")
    tables = [block.splitlines() for block in text.split("\n\n") if block.startswith("|")]
    assert len(tables) == 8
    for rows in tables:
        assert {row.count(" | ") for row in rows} == {rows[0].count(" | ")}
    rows = {row.split(" | ")[0]: row for row in tables[-1]}
    assert rows["| `clips-5`"].split(" | ")[1:3] == ["5", "all"]
    assert rows["| `clips-every-4`"].split(" | ")[1:3] == ["20", "1 in 4"]
    assert rows["| `clips-two-thirds`"].split(" | ")[1:3] == ["20", "first 67%"]
    assert any(row.startswith("| A hand's clips, XIRL") for table in tables for row in table)
    metrics = json.loads((beyond / "metrics/beyond.json").read_text())
    told = {cell for part in ("choice", "clips", "imitation", "tasks") for cell in metrics[part]}
    assert told == {*params.beyond.cells, "ours"}
    assert metrics["clips"]["clips-1"].keys() == {
        "runs",
        *(
            f"{name}{end}"
            for name in ("success_rate", "final_distance_median")
            for end in ("", "_low", "_high")
        ),
    }


def test_the_picture_that_moves_shows_both_clips(beyond):
    """Expert, translation and agent abreast; red's frames, then green's, each held at its end; below 1 MB."""
    path = beyond / "data/beyond/figures/clip-decides.webp"
    assert path.stat().st_size < 1_000_000
    done, animation = cv2.imreadanimation(str(path))
    assert done
    assert animation.loop_count == 0
    assert {frame.shape[:2] for frame in animation.frames} == {(24 + 3 * SIZE, 9 * SIZE)}
    assert len(animation.frames) == len(animation.durations) == 52
    held = np.flatnonzero(np.array(animation.durations) == 1500)
    assert list(held) == [25, 51]
    # The experts' discs end at their right; the words above differ in the goal alone.
    red, green = (animation.frames[index][:24, : 3 * SIZE, :3].astype(int) for index in held)
    assert np.abs(red - green).max() > 100


def test_a_part_gives_a_page_too(data, report):
    data.policies("clips-2", 0.02)
    done = report(data.root, "beyond")
    assert done.returncode == 0, done.stderr
    page = (data.root / "data/beyond/report.md").read_text(encoding="utf-8")
    assert "`clips-2`" in page
    assert "## Choice" in page
    assert not list((data.root / "data/beyond/figures").glob("*.webp"))
