"""`anyview review`: what a pull request changes, as Markdown; `anyview sweep`: experiments as one picture."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from anyview.runtime.errors import AnyviewError
from anyview.runtime.outputs import write_atomically

if TYPE_CHECKING:
    from anyview.report.review import MetricChange

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
            "--images", metavar="URL", help="Show strips from URL/COMMIT/PATH instead of naming paths."
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for a script.")] = False,
) -> None:
    """Summarise what changed since REV: params, metrics beyond their intervals, strips, stages rerun.

    Prints Markdown, made to be pasted or posted into a pull request.
    """
    from anyview.report.review import compare
    from anyview.report.review_markdown import to_markdown
    from anyview.report.revisions import Revision, find_revision

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


def sweep(
    key: Annotated[str, typer.Argument(metavar="KEY", help="Of params.yaml, such as imitation.reward.phi.")],
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

    Counts the experiments of the current commit that differ from it in KEY alone, and the commit itself.
    """
    from anyview.report.figures.style import to_png, to_svg
    from anyview.report.figures.sweep import sweep as draw
    from anyview.report.sweeps import read_sweep, table

    if output.suffix not in (".svg", ".png"):
        raise AnyviewError(f"{output}: the picture must end in .svg or .png")
    found = read_sweep(key, metric or OURS)
    figure = draw(found)
    write_atomically(output, to_png(figure) if output.suffix == ".png" else to_svg(figure))
    if as_json:
        trials = [
            {
                "experiment": trial.name,
                "value": trial.params[key],
                "metrics": {name: asdict(trial.metrics[name]) for name in found.metrics},
            }
            for trial in found.trials
        ]
        print(
            json.dumps(
                {"key": key, "output": str(output), "left_out": found.left_out, "trials": trials}, indent=2
            )
        )
        return
    print("\n".join(table(found)))
    if found.left_out:
        print(f"left out: {found.left_out} that vary something else too, or have no such metrics yet")
    print(f"drawn: {output}")


def _metric(change: "MetricChange") -> dict[str, Any]:
    return {**asdict(change), "beyond": change.beyond}
