"""A review as Markdown for a pull request: short where little changed, tables where much did."""

from collections.abc import Iterator
from typing import Any

from anyview.report.review import MetricChange, Reading, Review, StageChange
from anyview.report.revisions import Revision

_ABSENT = "–"


def to_markdown(review: Review, before: Revision, after: Revision, images: str | None = None) -> str:
    """``review`` as Markdown. Below the URL ``images``, ``<commit>/<path>`` serves a strip."""
    lines = [f"## Anyview: `{review.before}` → `{review.after}`", ""]
    lines += _params(review)
    lines += _metrics(review)
    lines += _strips(review, before, after, images)
    lines += _stages(review)
    return "\n".join(lines).rstrip() + "\n"


def _params(review: Review) -> Iterator[str]:
    yield from _heading("Params", len(review.params))
    if review.params:
        yield from _table("param", "before", "after")
        for change in review.params:
            yield _row(f"`{change.key}`", _code(change.before), _code(change.after))
        yield ""


def _metrics(review: Review) -> Iterator[str]:
    yield from _heading("Metrics", len(review.metrics))
    if not review.metrics:
        return
    beyond = sum(change.beyond for change in review.metrics)
    yield f"{beyond} of {len(review.metrics)} moved beyond their 95% intervals (**bold**: each value lies"
    yield "outside the other's interval); the rest is within the luck of the draw, or has no interval."
    yield ""
    yield from _table("metric", "before", "after", "change")
    for change in sorted(review.metrics, key=lambda change: not change.beyond):
        cells = [f"`{change.key}`", _reading(change.before), _reading(change.after), _difference(change)]
        yield _row(*(f"**{cell}**" for cell in cells)) if change.beyond else _row(*cells)
    yield ""


def _strips(review: Review, before: Revision, after: Revision, images: str | None) -> Iterator[str]:
    yield from _heading("Strips", len(review.strips))
    if not review.strips:
        return
    yield from _table("strip", "before", "after")
    for path in review.strips:
        yield _row(
            f"`{path.rsplit('/', 1)[-1]}`", *(_picture(path, state, images) for state in (before, after))
        )
    yield ""


def _stages(review: Review) -> Iterator[str]:
    yield from _heading("Stages that reran", len(review.stages))
    if review.stages:
        yield from _table("stage", "because of", "outputs")
        for change in review.stages:
            yield _row(
                f"`{change.name}`", _causes(change), "changed" if change.outputs_changed else "the same bytes"
            )
        yield ""
    yield f"Unchanged: {review.unchanged_stages}."


def _heading(title: str, count: int) -> Iterator[str]:
    yield f"### {title}" + ("" if count else ": unchanged")
    yield ""


def _table(*titles: str) -> Iterator[str]:
    yield _row(*titles)
    yield _row(*("---" for _ in titles))


def _row(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _code(value: Any) -> str:
    return _ABSENT if value is None else f"`{value}`"


def _reading(reading: Reading | None) -> str:
    return _ABSENT if reading is None else str(reading)


def _difference(change: MetricChange) -> str:
    if change.before is None or change.after is None:
        return "new" if change.before is None else "gone"
    return f"{change.after.value - change.before.value:+.4g}"


def _picture(path: str, state: Revision, images: str | None) -> str:
    if path not in state.files(path):
        return _ABSENT
    if images and state.sha:
        return f"![{path} at {state.name}]({images.rstrip('/')}/{state.sha}/{path})"
    return f"`{state.sha[:10]}:{path}`" if state.sha else f"`{path}`"


def _causes(change: StageChange) -> str:
    shown = [f"`{cause}`" if "." in cause or "/" in cause else cause for cause in change.causes[:4]]
    more = len(change.causes) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more > 0 else "")
