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


def angles(data: Data, cell: str, distance: float) -> None:
    """Five contexts, each at three angles; of `choice-angles` for the one goal alone."""
    data.policies(cell, distance)
    folder = data.root / "data/policies" / cell
    runs = pd.read_csv(folder / "runs.csv")
    runs.insert(1, "context", runs["run"] % 5)
    if cell.startswith("choice"):
        runs.insert(2, "choice", "red")
    runs.insert(2, "angle", np.repeat([0, 90, 180], 5))
    runs.to_csv(folder / "runs.csv", index=False)


def rankings(data: Data, methods: list[str]) -> None:
    """Of every failure but the last, a good rollout earns more; of that one it earns less in one context."""
    rows, values = [], []
    for cell in methods:
        kinds = ["good", "still", "wrong_place"] + (["other_goal"] if cell.startswith("choice") else [])
        for context in range(4):
            for kind in kinds:
                score = {"good": -1, kinds[-1]: -2 if context else 0}.get(kind, -3)
                rows.append((cell, context, context, kind, 0, 0.1, score))
            values += [(cell, context, context, step, step**2) for step in (1, 5, 9)]
    folder = data.root / "data/rankings"
    folder.mkdir()
    names = ["cell", "context", "run", "kind", "rollout", "final_distance", "return"]
    pd.DataFrame(rows, columns=names).to_csv(folder / "rollouts.csv", index=False)
    pd.DataFrame(values, columns=[*names[:3], "step", "value"]).to_csv(folder / "values.csv", index=False)


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
        make = angles if cell.angles else two_goals if cell.dataset == "choice" else Data.policies
        make(data, name, 0.01 + 0.02 * index)
    rankings(data, params.beyond.ranking.methods)
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
    wanted |= {"any-viewpoint", "success-and-distance-by-angle", "rewards-that-know-failure"}
    assert wanted <= set(page.ids)
    assert all(page.alternatives)


def test_tables_tell_of_every_cell(beyond, params):
    text = (beyond / "data/beyond/report.md").read_text(encoding="utf-8")
    tables = [block.splitlines() for block in text.split("\n\n") if block.startswith("|")]
    assert len(tables) == 10
    for rows in tables:
        assert {row.count(" | ") for row in rows} == {rows[0].count(" | ")}
    rows = {row.split(" | ")[0]: row for row in tables[-1]}
    assert rows["| `clips-5`"].split(" | ")[2:4] == ["5", "all"]
    assert rows["| `clips-every-4`"].split(" | ")[2:4] == ["20", "1 in 4"]
    assert rows["| `clips-two-thirds`"].split(" | ")[2:4] == ["20", "first 67%"]
    by_angle, by_reward = tables[5:7]
    assert [row.split(" | ")[:2] for row in by_angle[2:]] == [
        [f"| {name} (one clip)", f"{angle}°"] for name in ("Ours", "Choice") for angle in (0, 90, 180)
    ]
    rows = {row.split(" | ")[0]: row.split(" | ")[1:] for row in by_reward}
    assert rows["| Reward of"][2:] == ["Still", "Wrong place", "Other goal |"]
    assert [cell.split()[0] for cell in rows["| `gail`"]] == ["1", "87.5%", "100%", "75%", "–"]
    assert [cell.split()[0] for cell in rows["| `choice`"]] == ["1", "91.7%", "100%", "100%", "75%"]
    assert rows["| Nothing but the time"] == ["1", "0%", "0%", "0%", "0% |"]
    assert any(row.startswith("| A hand's clips, XIRL") for table in tables for row in table)
    metrics = json.loads((beyond / "metrics/beyond.json").read_text())
    assert metrics["rewards"]["gail"].keys() == {
        f"{name}{end}" for name in ("value_order", "refused") for end in ("", "_low", "_high")
    }
    assert metrics["viewpoints"]["choice-angles"].keys() == {
        "0",
        "90",
        "180",
        "lost",
        "lost_low",
        "lost_high",
    }
    told = {
        cell for part in ("choice", "clips", "viewpoints", "imitation", "tasks") for cell in metrics[part]
    }
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
