"""The evidence's tables and figures, into evidence/results.

Usage, in evidence/, once stages have run: python report.py
"""

from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd
from matplotlib.figure import Figure

from anyview.analysis import diversity, headline, replicates
from anyview.analysis.cells import OURS
from anyview.config import Params, load_params
from anyview.paths import DATA
from anyview.report.figures import diversity as diversity_figures
from anyview.report.figures import losses as losses_figures
from anyview.report.figures.style import to_svg
from anyview.report.formatting import percent
from anyview.report.text import ACTIONS, environment
from anyview.runtime.errors import AnyviewError, refuse_arguments, run_stage
from anyview.runtime.outputs import whole_folder

RESULTS = Path("results")


class Part(NamedTuple):
    """A part's tables, figures, and what its page has besides them."""

    tables: dict[str, pd.DataFrame]
    figures: dict[str, Figure]
    page: dict[str, Any]


def losses(params: Params) -> Part | None:
    """Figure 20: every loss and reward of which all seeds were run."""
    runs, curves = replicates.read_replicates(params)
    if runs.empty:
        return None
    budget = params.evidence.losses
    steps = budget.episodes_per_iteration * ACTIONS
    tables = {
        "rates": replicates.rates(runs),
        "ablations": replicates.ablations(runs),
        "claims": replicates.claims(curves, steps),
        "learning": replicates.learning(curves, steps),
        "shares": replicates.shares(runs, budget.every_reward),
        "shared": replicates.rates(runs[runs["seed"].isin(budget.others.seeds)]),
    }
    figures = {
        "success": losses_figures.success(tables["rates"]),
        "learning": losses_figures.learning(tables["learning"]),
    }
    page = {
        "steps": budget.iterations * steps,
        "budgets": list(tables["claims"]["steps"].unique()),
        "verdicts": list(replicates.verdicts(tables["claims"]).itertuples()),
        "parts": _parts(tables["shares"]),
        "few": bool((tables["claims"]["claim"] == "few").any()),
        "enough": replicates.ENOUGH_TRANSLATORS,
    }
    return Part(tables, figures, page)


def _parts(shares: pd.DataFrame) -> dict[tuple[str, str], str]:
    """L_f's part of a raw reward with all losses and without one, by reward and cell, as text."""
    found = shares.set_index(["reward", "cell"])["share"]
    return {
        (reward, cell): f"{percent(found[reward, OURS])}, {percent(share)}"
        for (reward, cell), share in found.items()
        if (reward, OURS) in found
    }


def diverse(params: Params) -> Part | None:
    """How much diversity: whatever was evaluated."""
    runs = diversity.read_diversity(params)
    if runs.empty:
        return None
    levels = diversity.levels(params)
    tables = {
        "rates": diversity.rates(runs),
        "effects": diversity.effects(runs, levels),
        "leaving": diversity.leaving(runs),
        "angles": diversity.angles(runs, levels),
    }
    budget, points = params.evidence.diversity, diversity.points(runs, levels)
    page = {
        "steps": budget.iterations * budget.episodes_per_iteration * ACTIONS,
        "enough": list(diversity.enough(tables["effects"]).itertuples()),
        "evaluated": int(tables["rates"]["translators"].sum()),
        "planned": diversity.planned(params),
        "angled": not points.empty,
    }
    figures = {"views": diversity_figures.by_views(tables["rates"])}
    if not points.empty:
        figures["angles"] = diversity_figures.by_angle(points)
    return Part(tables, figures, page)


def main_methods(params: Params) -> Part | None:
    """The main methods of which all seeds were run."""
    runs = headline.read_headline(params)
    if runs.empty:
        return None
    tables = {"rates": headline.rates(runs), "contrasts": headline.against_ours(runs)}
    budget = params.evidence.headline
    return Part(tables, {}, {"steps": budget.iterations * budget.episodes_per_iteration * ACTIONS})


def main(arguments: list[str]) -> None:
    """Report on every part of which something was run."""
    refuse_arguments(arguments, "python report.py")
    params = load_params()
    found = {"losses": losses, "diversity": diverse, "headline": main_methods}
    parts = {name: part for name, read in found.items() if (part := read(params))}
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
