"""The report as Markdown, from the templates: one text for ``report.md`` and for the page."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from anyview.analysis import thesis
from anyview.analysis.cells import ablated, compared, in_order, label
from anyview.analysis.curves import PUBLISHED
from anyview.analysis.results import Results
from anyview.analysis.study import Study
from anyview.report import formatting
from anyview.report.illustrations import Illustrations

TEMPLATES = Path(__file__).parent / "templates"
ACTIONS = 49
"""In an episode."""

_FILTERS: tuple[Callable[..., str], ...] = (
    formatting.number,
    formatting.count,
    formatting.published,
    formatting.spread,
    formatting.percent,
    formatting.percent_spread,
    formatting.whole_percent,
    formatting.rate_spread,
    formatting.centimetres,
    formatting.centimetres_spread,
    formatting.times,
    formatting.probability,
    formatting.listed,
    formatting.plural,
    label,
)


def environment(autoescape: bool) -> Environment:
    """Our templates, strict about names, with the formats of ``formatting`` as filters."""
    made = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=autoescape,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters |= {function.__name__: function for function in _FILTERS}
    made.filters["separator"] = lambda loop: "" if loop.last else " and " if loop.revindex == 2 else ", "
    return made


def write_markdown(
    study: Study, results: Results, illustrations: Illustrations, picture: Callable[[str], str]
) -> str:
    """The report; ``picture(name)`` stands where the illustration ``name`` belongs."""
    text = environment(autoescape=False).get_template("report.md.jinja")
    written = text.render(
        study=study,
        params=study.params,
        results=results,
        illustrations=illustrations,
        picture=picture,
        thesis=thesis,
        published_runs=PUBLISHED,
        **_context(study, results),
    )
    return re.sub(r"\n{3,}", "\n\n", written).strip() + "\n"


def _context(study: Study, results: Results) -> dict[str, Any]:
    """Tables as the templates read them, and which cells each chapter names."""
    imitation = study.params.imitation
    return {
        **{
            name: by_cell(getattr(results, name))
            for name in ("data", "translation", "imitation", "more", "viewpoints")
        },
        **{
            name: list(getattr(results, name).itertuples())
            for name in ("loss_points", "optimizers", "weight_ranges", "differences", "effects")
        },
        "real_cells": [cell for cell in study.translators if study.is_real(cell)],
        "with_extreme": [cell for cell, entry in study.translators.items() if entry.filmed("extreme")],
        "missing": in_order(set(study.params.methods) - set(study.methods)),
        "compared": compared(study.methods),
        "ablated": ablated(study.methods),
        "steps": imitation.iterations * imitation.episodes_per_iteration * ACTIONS,
    }


def by_cell(table: pd.DataFrame) -> dict[str, dict[str, Any]]:
    """Rows of a tidy table by cell and metric."""
    return {
        str(cell): {row.metric: row for row in rows.itertuples()}
        for cell, rows in table.groupby("cell", sort=False)
    }
