"""The report stage as a user runs it, and the page that it writes."""

import shutil
import xml.etree.ElementTree as ElementTree
from html.parser import HTMLParser
from pathlib import Path

import pandas as pd
import pytest

FIGURES = [f"figure-{number}" for number in range(13, 21)]


def contents(root: Path) -> dict[str, bytes]:
    places = [root / "data/report", root / "metrics"]
    files = [path for place in places for path in place.rglob("*") if path.is_file()]
    return {path.relative_to(root).as_posix(): path.read_bytes() for path in files}


class Reader(HTMLParser):
    """What a page refers to, and what it says."""

    def __init__(self, text: str):
        super().__init__()
        self.ids, self.sources, self.links, self.words, self.alternatives = [], [], [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        if "id" in values:
            self.ids.append(values["id"])
        if "src" in values:
            self.sources.append(values["src"])
        if "href" in values:
            self.links.append(values["href"])
        if tag == "img":
            self.alternatives.append(values.get("alt"))

    def handle_data(self, data):
        self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).replace("\u00a0", " ").split())


@pytest.fixture(scope="module")
def whole(full, report):
    done = report(full)
    assert done.returncode == 0, done.stderr
    return full


@pytest.fixture(scope="module")
def page(whole):
    return Reader((whole / "data/report/index.html").read_text(encoding="utf-8"))


def test_the_page_needs_nothing_but_itself(page, whole):
    assert all(source.startswith("data:") for source in page.sources)
    assert all(link.startswith(("#", "data:")) for link in page.links)
    assert "url(http" not in (whole / "data/report/index.html").read_text(encoding="utf-8")
    assert (whole / "data/report/index.html").stat().st_size < 10_000_000


def test_every_anchor_exists_once_and_every_picture_has_words(page):
    anchors = [link[1:] for link in page.links if link.startswith("#")]
    assert set(anchors) <= set(page.ids)
    assert all(page.alternatives)
    assert len(page.ids) == len(set(page.ids))


def test_figures_13_to_20_stand_beside_the_thesis(page):
    assert set(FIGURES) <= set(page.ids)
    for number in ("47,564", "26,469", "0.025", "4,232", "11,562", "2,302", "86.7%", "73.3%", "46.7%"):
        assert number in page.text


def test_surrogate_clips_are_called_so(page):
    assert "Surrogate clips. The thesis’s webcam clips were never published." in page.text
    for figure in (13, 14, 15, 16, 17):
        start = page.text.index(f"Figure {figure}.")
        assert "surrogate" in page.text[start : start + 120]


def test_the_page_says_what_it_was_made_from(page, whole):
    for place in ("data/clips/diverse", "data/models/sim", "data/policies/ours"):
        assert place in page.text
    assert "learning_rate: 0.001" in page.text


def test_the_numbers_come_as_markdown_too(whole):
    """Every row of a table has as many cells as its headings, and the claims are those of the page."""
    text = (whole / "data/report/report.md").read_text(encoding="utf-8")
    tables = [block.splitlines() for block in text.split("\n\n") if block.startswith("|")]
    assert len(tables) > 8
    for rows in tables:
        assert {row.count(" | ") for row in rows} == {rows[0].count(" | ")}
    thesis, here = next(row for row in text.splitlines() if row.startswith("| GAIL")).split(" | ")[1:3]
    assert thesis.startswith("0%")
    assert here.startswith(("0%", "6.7%"))
    assert "Farther from the goal than ours" in text
    assert "| real-adam | 120° | 6 | " in text


def test_figures_are_files_of_their_own_too(whole):
    for path in (whole / "data/report/figures").iterdir():
        ElementTree.parse(path)
    assert (whole / "data/report/figures/figure-19.svg").exists()


def test_plots_hold_every_cell_and_stay_short(whole):
    table = pd.read_csv(whole / "metrics/plots/final_distance.csv")
    assert list(table.columns) == ["cell", "iteration", "final_distance", "low", "high"]
    assert (table["low"] <= table["final_distance"]).all()
    assert (table["final_distance"] <= table["high"]).all()
    assert {"ours", "oracle", "gail"} <= set(table["cell"])
    assert table.groupby("cell").size().max() <= 101
    assert (whole / "metrics/plots/strips/sim.png").exists()
    assert (whole / "metrics/plots/idea.png").exists()


def test_the_same_results_give_the_same_bytes(whole, report):
    first = contents(whole)
    assert report(whole).returncode == 0
    assert contents(whole) == first


def test_a_part_of_the_study_gives_a_page(data, report):
    data.demonstrations("diverse")
    data.translator("sim")
    for cell in ("ours", "oracle"):
        data.policies(cell, 0.03)
    done = report(data.root)
    assert done.returncode == 0, done.stderr
    page = Reader((data.root / "data/report/index.html").read_text(encoding="utf-8"))
    assert "Not run in this study: Liu (TRPO, diverse)" in page.text
    assert {"figure-18", "figure-19", "final-distance-against-ours"} <= set(page.ids)
    assert not {"figure-13", "figure-17", "figure-20", "what-the-thesis-leaves-open"} & set(page.ids)
    assert "Surrogate clips." not in page.text


def test_demonstrations_alone_give_a_page(data, report):
    data.demonstrations("narrow")
    done = report(data.root)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda root: shutil.rmtree(root / "data"), "nothing to report on yet"),
        (lambda root: (root / "data/policies/ours/runs.csv").unlink(), "runs.csv: no such file"),
        (lambda root: (root / "data/policies/ours/rollouts/run-00.avi").write_bytes(b"?"), "run-00.avi"),
    ],
)
def test_bad_input_is_one_line_and_leaves_no_output(data, report, spoil, message):
    data.policies("ours", 0.03)
    spoil(data.root)
    done = report(data.root)
    assert done.returncode == 2
    assert done.stderr.startswith("error: ")
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (data.root / "data/report").exists()
    assert not (data.root / "metrics").exists()
