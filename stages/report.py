"""Stage `report`: metrics for Git, plots for DVC, figures 13 to 20 and the report page.

Usage: python stages/report.py
"""

from pathlib import Path

from anyview.analysis.metrics import metrics, write_metrics
from anyview.analysis.results import analyse
from anyview.analysis.study import read_study
from anyview.config import load_params, read_yaml
from anyview.paths import METRICS, REPORT
from anyview.report.illustrations import illustrate
from anyview.report.page import picture, render_page
from anyview.report.plots import write_plots
from anyview.report.text import write_markdown
from anyview.runtime.errors import AnyviewError, run_stage
from anyview.runtime.outputs import whole_folder


def main(arguments: list[str]) -> None:
    """Report on everything that was run."""
    if arguments:
        raise AnyviewError("usage: python stages/report.py")
    study = read_study(load_params())
    results = analyse(study)
    trees = metrics(results)
    illustrations = illustrate(study, results)
    text = write_markdown(study, results, illustrations, picture=lambda name: "")
    with_pictures = write_markdown(study, results, illustrations, picture)
    page = render_page(with_pictures, illustrations, study, read_yaml(Path("dvc.yaml")))
    with whole_folder(REPORT) as folder:
        (folder / "figures").mkdir()
        for name, svg in illustrations.figures.items():
            (folder / "figures" / f"{name}.svg").write_text(svg, encoding="utf-8")
        (folder / "index.html").write_text(page, encoding="utf-8")
        (folder / "report.md").write_text(text, encoding="utf-8")
    with whole_folder(METRICS / "plots") as folder:
        write_plots(folder, study, results)
    write_metrics(METRICS, trees)
    print(f"report: {REPORT / 'index.html'}")


if __name__ == "__main__":
    run_stage(main)
