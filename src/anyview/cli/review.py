"""`anyview review`: what a pull request changes, as Markdown; `anyview sweep`: experiments as one picture."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from anyview.runtime.errors import AnyviewError
from anyview.runtime.outputs import write_atomically

OURS = ("imitation.ours.success_rate", "imitation.ours.final_distance_median")


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
            "--images", metavar="URL", help="Show pictures from URL/COMMIT/PATH instead of naming paths."
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for a script.")] = False,
) -> None:
    """Summarise what changed since REV: metrics beyond their intervals, params, pictures, stages rerun.

    Prints Markdown for a pull request: a screenful of metrics beyond their intervals, the rest folded.
    """
    from anyview.review.changes import compare
    from anyview.review.markdown import to_markdown
    from anyview.review.revisions import Revision, find_revision

    root = Path()
    before = find_revision(root, revision)
    after = find_revision(root, to) if to else Revision(root)
    changes = compare(before, after)
    if as_json:
        metrics = [
            asdict(change) | {"beyond_intervals": change.beyond_intervals} for change in changes.metrics
        ]
        states = {"before": before.name, "after": after.name}
        print(json.dumps(asdict(changes) | states | {"metrics": metrics}, indent=2, default=str))
    else:
        print(to_markdown(changes, images), end="")


def sweep(
    key: Annotated[
        str, typer.Argument(metavar="KEY", help="Of params.yaml, such as imitation.cells.ours.weights.image.")
    ],
    metric: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="What to draw, named as in `anyview review`; repeat for more "
            "(by default success and final distance of ours)",
        ),
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="The picture, .svg or .png.")] = Path(
        "sweep.svg"
    ),
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for a script.")] = False,
) -> None:
    """Draw what a sweep of KEY by `dvc exp` did to the metrics, as one picture and one table.

    Shows the current commit and its finished experiments that differ from it in KEY alone.
    """
    from anyview.report.figures.style import to_png, to_svg
    from anyview.review.sweep_figure import sweep as draw
    from anyview.review.sweeps import read_sweep, table

    if output.suffix not in (".svg", ".png"):
        raise AnyviewError(f"{output}: the picture must end in .svg or .png")
    found = read_sweep(key, metric or OURS)
    figure = draw(found)
    write_atomically(output, to_png(figure) if output.suffix == ".png" else to_svg(figure))
    if as_json:
        print(json.dumps(asdict(found) | {"output": str(output)}, indent=2))
        return
    print(table(found))
    if found.left_out:
        print(f"left out: {found.left_out} that vary something else too, or have no such metrics")
    print(f"drawn: {output}")
