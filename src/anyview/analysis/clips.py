"""How many clips does a reward need, and how complete? Methods in contexts that no evaluation uses."""

from collections.abc import Iterator
from typing import NamedTuple

import pandas as pd

from anyview.analysis.comparisons import Methods
from anyview.analysis.estimates import Estimate, Estimator, proportion, tidy, without_interval
from anyview.analysis.study import EvaluatedMethod
from anyview.config import BeyondCell, Params

SUCCESS, DISTANCE = "success_rate", "final_distance_median"


class Curves(NamedTuple):
    """Cells of the two curves: by the number of clips, and by the frames that these have."""

    by_count: list[str]
    by_frames: list[str]


def tuning(params: Params, methods: Methods) -> dict[str, EvaluatedMethod]:
    """The methods in tuning contexts, in the order of params."""
    cells = _demonstrated(params)
    return {cell: methods[cell] for cell in cells if cell in methods and cells[cell].contexts == "tuning"}


def by_clips(params: Params, methods: Methods, estimator: Estimator) -> pd.DataFrame:
    """A table as ``estimates.tidy`` makes it: ``success_rate`` (Wilson) and ``final_distance_median``."""
    return tidy(_by_clips(tuning(params, methods), estimator))


def curves(params: Params, table: pd.DataFrame) -> Curves:
    """Which cells of ``by_clips`` are on which curve. The second begins with as many complete clips."""
    cells = {cell: _demonstrated(params)[cell] for cell in table["cell"].unique()}
    complete = [cell for cell, method in cells.items() if _complete(method)]
    incomplete = [cell for cell in cells if cell not in complete]
    numbers = {cells[cell].demonstrations for cell in incomplete}
    beside = [cell for cell in complete if cells[cell].demonstrations in numbers][-1:]
    return Curves(sorted(complete, key=lambda cell: cells[cell].demonstrations), [*beside, *incomplete])


def _by_clips(methods: Methods, estimator: Estimator) -> Iterator[tuple[str, str, Estimate]]:
    for cell, method in methods.items():
        runs = method.runs
        yield cell, "runs", without_interval(len(runs))
        yield cell, SUCCESS, proportion(int(runs["success"].sum()), len(runs))
        distances = runs["final_distance"].to_numpy(float)
        yield cell, DISTANCE, estimator.median(f"{cell}/final_distance", distances)


def _demonstrated(params: Params) -> dict[str, BeyondCell]:
    """The cells whose reward follows clips from their start to their end."""
    return {name: cell for name, cell in params.beyond.cells.items() if isinstance(cell, BeyondCell)}


def _complete(cell: BeyondCell) -> bool:
    return cell.incomplete.every == 1 and cell.incomplete.until == 1
