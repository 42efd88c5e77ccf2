"""Other tasks than the thesis's: for each, how far its methods come."""

from anyview.analysis.study import EvaluatedMethod, Study

THESIS = "push"


def by_task(study: Study) -> dict[str, dict[str, EvaluatedMethod]]:
    """The methods of each other task, by task and cell, in the order of params."""
    beyond = study.params.beyond
    found: dict[str, dict[str, EvaluatedMethod]] = {}
    for cell, params in beyond.cells.items():
        dataset = beyond.sets.get(params.dataset)
        if dataset is not None and dataset.task != THESIS and cell in study.methods:
            found.setdefault(dataset.task, {})[cell] = study.methods[cell]
    return found
