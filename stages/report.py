"""Stage `report`: metrics for Git, plots for DVC, figures 13 to 20 and the report page.

Usage: python stages/report.py
"""

from pathlib import Path

from anyview.config import load_params, read_yaml
from anyview.report.inputs import read_study
from anyview.report.markdown import digest
from anyview.report.metrics import data_metrics, imitation_metrics, translation_metrics, write_metrics
from anyview.report.page import render, sections, write_figures
from anyview.report.plots import write_plots
from anyview.runtime.errors import AnyviewError, run_stage
from anyview.runtime.outputs import whole_folder

DATA = Path("data")


def main(arguments: list[str]) -> None:
    """Report on everything that was run."""
    if arguments:
        raise AnyviewError("usage: python stages/report.py")
    study = read_study(DATA, load_params())
    data, translation, imitation = data_metrics(study), translation_metrics(study), imitation_metrics(study)
    chapters = sections(study, data, translation, imitation)
    page = render(study, chapters, translation, imitation, read_yaml(Path("dvc.yaml")), study.sources)
    with whole_folder(DATA / "report") as folder:
        write_figures(folder / "figures", chapters)
        (folder / "index.html").write_text(page, encoding="utf-8")
        (folder / "report.md").write_text(digest(chapters), encoding="utf-8")
    with whole_folder(Path("metrics/plots")) as folder:
        write_plots(folder, study)
    for name, metrics in (("data", data), ("translation", translation), ("imitation", imitation)):
        write_metrics(Path("metrics") / f"{name}.json", metrics)
    print(f"report: {DATA / 'report' / 'index.html'}")


if __name__ == "__main__":
    run_stage(main)
