"""The results of what goes beyond the thesis as tidy tables, and their metrics."""

from dataclasses import dataclass, replace

import pandas as pd

from anyview.analysis.choice import against_choice, choices, choosing
from anyview.analysis.clips import by_clips, tuning
from anyview.analysis.estimates import Estimator
from anyview.analysis.metrics import Tree, details
from anyview.analysis.ranking import ORDER, REFUSED, ranked
from anyview.analysis.results import Results, analyse, outcomes
from anyview.analysis.study import Study
from anyview.analysis.tasks import by_task
from anyview.analysis.viewpoints import by_angle, viewing


@dataclass(frozen=True)
class BeyondResults:
    """``choices`` and ``against_choice``: see ``analysis.choice``; ``clips``: see ``analysis.clips``.

    ``viewpoints``: see ``viewpoints.by_angle``; ``rewards``: see ``ranking.ranked``. ``tasks``:
    ``results.outcomes`` in other tasks. ``others``: all else, as of the thesis.
    """

    choices: pd.DataFrame
    against_choice: pd.DataFrame
    clips: pd.DataFrame
    viewpoints: pd.DataFrame
    rewards: pd.DataFrame
    tasks: pd.DataFrame
    others: Results


def analyse_beyond(study: Study) -> BeyondResults:
    """Compute every table. ``study`` was read by params ``going_beyond``."""
    estimator = Estimator(study.params.base.seed)
    elsewhere = {cell: method for methods in by_task(study).values() for cell, method in methods.items()}
    at_angles = viewing(study.methods)
    methods = {cell: method for cell, method in study.methods.items() if cell not in at_angles}
    apart = {*choosing(methods), *tuning(study.params, methods), *elsewhere}
    alone = {cell: method for cell, method in methods.items() if cell not in apart}
    return BeyondResults(
        choices(methods, estimator),
        against_choice(methods, estimator),
        by_clips(study.params, methods, estimator),
        by_angle(at_angles, estimator),
        ranked(study.rankings, estimator),
        outcomes(elsewhere, estimator),
        analyse(replace(study, methods=alone)),
    )


def beyond_metrics(results: BeyondResults) -> Tree:
    """The tree of ``metrics/beyond.json``; ``imitation`` is in the thesis's own task.

    Of ``rewards`` it has the two numbers that sum up each; the page has the kinds of failures.
    """
    rewards = results.rewards
    tables = {
        "data": results.others.data,
        "translation": results.others.translation,
        "choice": results.choices,
        "clips": results.clips,
        "viewpoints": results.viewpoints,
        "rewards": rewards[rewards["metric"].isin((ORDER, REFUSED))],
        "imitation": results.others.imitation,
        "tasks": results.tasks,
    }
    return {name: details(table) for name, table in tables.items()}
