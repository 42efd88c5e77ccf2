"""The evidence's tables and figures, into evidence/results.

Usage, in evidence/, once stages have run: python report.py
"""

from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd
from matplotlib.figure import Figure

from anyview.analysis import diversity, headline, replicates
from anyview.analysis.estimates import Estimator
from anyview.config import Params, load_params
from anyview.paths import DATA
from anyview.report.figures import diversity as diversity_figures
from anyview.report.figures import losses as losses_figures
from anyview.report.figures.style import to_svg
from anyview.report.text import ACTIONS, environment
from anyview.runtime.errors import AnyviewError, refuse_arguments, run_stage
from anyview.runtime.outputs import whole_folder

RESULTS = Path("results")


class Part(NamedTuple):
    """A part's tables, figures, and what its page has besides them."""

    tables: dict[str, pd.DataFrame]
    figures: dict[str, Figure]
    page: dict[str, Any]


def losses(params: Params, estimator: Estimator) -> Part | None:
    """Figure 20: every loss and reward of which all seeds were run."""
    runs, curves = replicates.read_replicates(params)
    if runs.empty:
        return None
    steps = params.imitation.episodes_per_iteration * ACTIONS
    tables = {
        "rates": replicates.rates(runs, estimator),
        "ablations": replicates.ablations(runs, estimator),
        "claims": replicates.claims(curves, estimator, steps),
        "learning": replicates.learning(curves, steps),
    }
    figures = {
        "success": losses_figures.success(tables["rates"]),
        "learning": losses_figures.learning(tables["learning"]),
    }
    page = {
        "steps": params.imitation.iterations * steps,
        "budgets": list(tables["claims"]["steps"].unique()),
        "verdicts": list(replicates.verdicts(tables["claims"]).itertuples()),
        "few": bool((tables["claims"]["claim"] == "few").any()),
        "enough": replicates.ENOUGH_TRANSLATORS,
    }
    return Part(tables, figures, page)


def diverse(params: Params, estimator: Estimator) -> Part | None:
    """How much diversity: whatever was evaluated."""
    runs = diversity.read_diversity(params)
    if runs.empty:
        return None
    tables = {
        "rates": diversity.rates(runs, estimator),
        "effects": diversity.effects(runs, diversity.levels(params), estimator),
        "angles": diversity.angles(runs),
    }
    imitation, enough = params.imitation, diversity.enough(tables["effects"])
    page = {
        "steps": imitation.iterations * imitation.episodes_per_iteration * ACTIONS,
        "enough": [
            (name, list(rows.itertuples())) for name, rows in enough.groupby("evaluation", sort=False)
        ],
        "evaluated": int(tables["rates"]["translators"].sum()),
        "planned": diversity.planned(params),
    }
    figures = {"diversity": diversity_figures.diversity(tables["rates"], tables["angles"])}
    return Part(tables, figures, page)


def main_methods(params: Params, estimator: Estimator) -> Part | None:
    """The main methods of which all seeds were run."""
    runs = headline.read_headline(params)
    if runs.empty:
        return None
    tables = {"rates": headline.rates(runs, estimator), "contrasts": headline.against_ours(runs, estimator)}
    budget = params.evidence.headline
    return Part(tables, {}, {"steps": budget.iterations * budget.episodes_per_iteration * ACTIONS})


def main(arguments: list[str]) -> None:
    """Report on every part of which something was run."""
    refuse_arguments(arguments, "python report.py")
    params = load_params()
    estimator = Estimator(params.base.seed)
    found = {"losses": losses, "diversity": diverse, "headline": main_methods}
    parts = {name: part for name, read in found.items() if (part := read(params, estimator))}
    if not parts:
        raise AnyviewError(f"{DATA}: nothing of the evidence is evaluated yet, or not with all of its seeds")
    with whole_folder(RESULTS) as results:
        for name, part in parts.items():
            folder = results / name
            folder.mkdir()
            rows = {table: list(values.itertuples()) for table, values in part.tables.items()}
            page = environment(autoescape=False).get_template(f"{name}.md.jinja")
            text = page.render(params=params, part=getattr(params.evidence, name), **rows, **part.page)
            (folder / "results.md").write_text(text.strip() + "\n", encoding="utf-8")
            for table, values in part.tables.items():
                values.to_csv(folder / f"{table}.csv", index=False, float_format="%.4g")
            for figure, drawn in part.figures.items():
                (folder / f"{figure}.svg").write_text(to_svg(drawn), encoding="utf-8")
            print(f"evidence: {RESULTS / name / 'results.md'}")


if __name__ == "__main__":
    run_stage(main)
