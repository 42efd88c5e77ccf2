"""A review as Markdown for a pull request: what moved beyond its interval in sight, the rest folded."""

from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from anyview.review.changes import Change, Review, StageChange
from anyview.review.revisions import Revision

ROWS = 46
"""Metrics in sight. With the lines around them, and those of the folds, at most sixty."""

_FIRST = ("success_rate", "final_distance_median", "validation.loss", "validation.psnr")
"""Ends of the keys that come first: what metrics/summary.json has of each method and each translator."""
_ABSENT = "–"
_CAUSES = 4


def to_markdown(review: Review, images: str | None = None) -> str:
    """``review`` as Markdown. Below the URL ``images``, ``<commit>/<path>`` serves a picture."""

    def picture(path: str, state: Revision, digest: str | None) -> str:
        if digest is None:
            return _ABSENT
        if images and state.sha:
            return f"![{path} at {state.name}]({images.rstrip('/')}/{state.sha}/{path})"
        return f"`{state.name}:{path}`" if state.sha else f"`{path}`"

    environment = Environment(
        loader=PackageLoader("anyview.review", "."), undefined=StrictUndefined, trim_blocks=True
    )
    environment.filters |= {"cell": _cell, "difference": _difference, "causes": _causes}
    beyond = sorted((change for change in review.metrics if change.beyond_intervals), key=_place)
    text = environment.get_template("review.md.jinja").render(
        review=review,
        picture=picture,
        beyond=beyond,
        rows=ROWS,
        others=[change for change in review.metrics if not change.beyond_intervals],
    )
    return text.rstrip() + "\n"


def _place(change: Change) -> int:
    return next((place for place, end in enumerate(_FIRST) if change.key.endswith(end)), len(_FIRST))


def _cell(value: Any, pattern: str = "{}") -> str:
    """``value`` in a cell of a table."""
    return _ABSENT if value is None else pattern.format(" ".join(str(value).split()).replace("|", "\\|"))


def _difference(change: Change) -> str:
    if change.before is None or change.after is None:
        return "new" if change.before is None else "gone"
    return f"{change.after.value - change.before.value:+.4g}"


def _causes(change: StageChange) -> str:
    shown = [f"`{cause}`" if "." in cause or "/" in cause else cause for cause in change.causes[:_CAUSES]]
    more = len(change.causes) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more else "")
