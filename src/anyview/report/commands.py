"""`anyview review`: what a pull request changes, as Markdown."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from anyview.report.review import MetricChange, compare
from anyview.report.review_markdown import to_markdown
from anyview.report.revisions import Revision, find_revision


def review(
    revision: Annotated[
        str, typer.Argument(metavar="REV", help="Compare against this branch, tag or commit.")
    ] = "HEAD",
    to: Annotated[
        str | None, typer.Option("--to", metavar="REV", help="Compare this revision, not the working tree.")
    ] = None,
    images: Annotated[
        str | None,
        typer.Option(
            "--images", metavar="URL", help="Show strips from URL/COMMIT/PATH instead of naming paths."
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for a script.")] = False,
) -> None:
    """Summarise what changed since REV: params, metrics beyond their intervals, strips, stages rerun.

    Prints Markdown, made to be pasted or posted into a pull request.
    """
    root = Path()
    before = find_revision(root, revision)
    after = find_revision(root, to) if to else Revision(root)
    changes = compare(before, after)
    if as_json:
        values: dict[str, Any] = asdict(changes)
        values["metrics"] = [_metric(change) for change in changes.metrics]
        print(json.dumps(values, indent=2))
    else:
        print(to_markdown(changes, before, after, images), end="")


def _metric(change: MetricChange) -> dict[str, Any]:
    return {**asdict(change), "beyond": change.beyond}
