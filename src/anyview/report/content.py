"""What the page is made of: sections of exhibits, each a picture or a table beside the thesis's numbers."""

from dataclasses import dataclass

from anyview.report.pictures import Film, Strip, side_by_side, webp


@dataclass(frozen=True)
class Table:
    """Rows of text under their headings; the first column names the row."""

    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""


@dataclass(frozen=True)
class Reel:
    """Films that play in step, under one set of controls."""

    title: str
    films: tuple[Film, ...]


@dataclass(frozen=True)
class StripView:
    """A strip on the page: each row one image, its label and the steps as text."""

    rows: tuple[tuple[str, str], ...]
    steps: tuple[int, ...]


@dataclass(frozen=True)
class Exhibit:
    """One figure of the page. ``figure`` is SVG; ``comparison`` holds the thesis's numbers beside ours."""

    key: str
    title: str
    text: tuple[str, ...] = ()
    figure: str = ""
    strip: StripView | None = None
    reels: tuple[Reel, ...] = ()
    comparison: Table | None = None
    table: Table | None = None
    surrogate: bool = False


@dataclass(frozen=True)
class Section:
    """A chapter of the page."""

    key: str
    title: str
    text: tuple[str, ...]
    exhibits: tuple[Exhibit, ...]


def view(strip: Strip) -> StripView:
    """``strip`` as images for the page."""
    rows = ((label, webp(side_by_side(frames), lossless=True)) for label, frames in strip.rows)
    return StripView(tuple(rows), strip.steps)
