"""The evidence's tables and figures, into evidence/results.

Usage, in evidence/, once its stages have run: python report.py
"""

from pathlib import Path

from anyview.analysis.estimates import Estimator
from anyview.analysis.replicates import ablations, learning, rates, read_replicates
from anyview.config import load_params
from anyview.report.figures import replicates
from anyview.report.figures.style import to_svg
from anyview.report.text import ACTIONS, environment
from anyview.runtime.errors import refuse_arguments, run_stage
from anyview.runtime.outputs import whole_folder

RESULTS = Path("results")


def main(arguments: list[str]) -> None:
    """Report on every translator and reward of which all seeds were run."""
    refuse_arguments(arguments, "python report.py")
    params = load_params()
    runs, curves = read_replicates(params)
    estimator = Estimator(params.base.seed)
    steps = params.imitation.episodes_per_iteration * ACTIONS
    tables = {
        "rates": rates(runs, estimator),
        "ablations": ablations(runs, estimator),
        "learning": learning(curves, steps),
    }
    text = (
        environment(autoescape=False)
        .get_template("replicates.md.jinja")
        .render(
            params=params,
            evidence=params.evidence,
            steps=params.imitation.iterations * steps,
            rates=list(tables["rates"].itertuples()),
            ablations=list(tables["ablations"].itertuples()),
        )
    )
    figures = {
        "success": replicates.success(tables["rates"]),
        "learning": replicates.learning(tables["learning"]),
    }
    with whole_folder(RESULTS) as folder:
        for name, table in tables.items():
            table.to_csv(folder / f"{name}.csv", index=False, float_format="%.4g")
        for name, figure in figures.items():
            (folder / f"{name}.svg").write_text(to_svg(figure), encoding="utf-8")
        (folder / "results.md").write_text(text.strip() + "\n", encoding="utf-8")
    print(f"evidence: {RESULTS / 'results.md'}")


if __name__ == "__main__":
    run_stage(main)
