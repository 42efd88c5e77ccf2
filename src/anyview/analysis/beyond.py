"""The results of what goes beyond the thesis as tidy tables, and their metrics."""

from dataclasses import dataclass, replace

import pandas as pd

from anyview.analysis.choice import against_choice, choices, choosing
from anyview.analysis.clips import by_clips, tuning
from anyview.analysis.estimates import Estimator
from anyview.analysis.metrics import Tree, details
from anyview.analysis.results import Results, analyse, outcomes
from anyview.analysis.study import Study
from anyview.analysis.tasks import by_task


@dataclass(frozen=True)
class BeyondResults:
    """``choices`` and ``against_choice``: see ``analysis.choice``; ``clips``: see ``analysis.clips``.

    ``tasks``: ``results.outcomes`` in other tasks. ``others``: all else, as of the thesis.
    """

    choices: pd.DataFrame
    against_choice: pd.DataFrame
    clips: pd.DataFrame
    tasks: pd.DataFrame
    others: Results


def analyse_beyond(study: Study) -> BeyondResults:
    """Compute every table. ``study`` was read by params ``going_beyond``."""
    estimator = Estimator(study.params.base.seed)
    elsewhere = {cell: method for methods in by_task(study).values() for cell, method in methods.items()}
    apart = {*choosing(study.methods), *tuning(study.params, study.methods), *elsewhere}
    alone = {cell: method for cell, method in study.methods.items() if cell not in apart}
    return BeyondResults(
        choices(study.methods, estimator),
        against_choice(study.methods, estimator),
        by_clips(study.params, study.methods, estimator),
        outcomes(elsewhere, estimator),
        analyse(replace(study, methods=alone)),
    )


def beyond_metrics(results: BeyondResults) -> Tree:
    """The tree of ``metrics/beyond.json``; ``imitation`` is in the thesis's own task."""
    tables = {
        "data": results.others.data,
        "translation": results.others.translation,
        "choice": results.choices,
        "clips": results.clips,
        "imitation": results.others.imitation,
        "tasks": results.tasks,
    }
    return {name: details(table) for name, table in tables.items()}
