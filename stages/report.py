"""Stage `report`: metrics for Git, plots for DVC, figures 13 to 20 and the report page; or what goes beyond.

Usage: python stages/report.py [beyond]
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from anyview.analysis.beyond import analyse_beyond, beyond_metrics
from anyview.analysis.cells import OURS
from anyview.analysis.metrics import metrics, write_metrics
from anyview.analysis.results import analyse
from anyview.analysis.study import Study, read_study
from anyview.config import Params, load_params, read_yaml
from anyview.paths import BEYOND, METRICS, REPORT
from anyview.report.beyond import illustrate_beyond, write_beyond
from anyview.report.illustrations import Illustrations, illustrate
from anyview.report.page import picture, render_page
from anyview.report.plots import write_plots
from anyview.report.text import write_markdown
from anyview.runtime.errors import AnyviewError, run_stage
from anyview.runtime.outputs import whole_folder


def report_thesis(params: Params) -> None:
    """Report on everything that was run of the thesis's study."""
    study = read_study(params)
    results = analyse(study)
    trees = metrics(results)
    illustrations = illustrate(study, results)
    write_report(REPORT, study, illustrations, partial(write_markdown, study, results, illustrations))
    with whole_folder(METRICS / "plots") as folder:
        write_plots(folder, study, results)
    write_metrics(METRICS, trees)


def report_beyond(params: Params) -> None:
    """Report on everything that was run beyond it."""
    study = read_study(params.going_beyond(OURS))
    results = analyse_beyond(study)
    tree = beyond_metrics(results)
    illustrations = illustrate_beyond(study, results)
    write_report(BEYOND, study, illustrations, partial(write_beyond, study, results, illustrations))
    write_metrics(METRICS, {"beyond": tree})


def write_report(output: Path, study: Study, illustrations: Illustrations, write: Callable[..., str]) -> None:
    """Write the folder of a report: what ``write(picture=...)`` gives, as text alone and as a page."""
    text = write(picture=lambda name: "")
    page = render_page(write(picture=picture), illustrations, study, read_yaml(Path("dvc.yaml")))
    with whole_folder(output) as folder:
        (folder / "figures").mkdir()
        for name, svg in illustrations.figures.items():
            (folder / "figures" / f"{name}.svg").write_text(svg, encoding="utf-8")
        for name, content in illustrations.moving.items():
            (folder / "figures" / f"{name}.webp").write_bytes(content)
        (folder / "index.html").write_text(page, encoding="utf-8")
        (folder / "report.md").write_text(text, encoding="utf-8")
    print(f"report: {output / 'index.html'}")


def main(arguments: list[str]) -> None:
    """Report on the thesis's study, or on what goes beyond it."""
    if arguments not in ([], ["beyond"]):
        raise AnyviewError("usage: python stages/report.py [beyond]")
    params = load_params()
    if arguments:
        report_beyond(params)
    else:
        report_thesis(params)


if __name__ == "__main__":
    run_stage(main)
