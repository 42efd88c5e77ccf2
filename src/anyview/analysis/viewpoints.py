"""Does it matter from where a clip was filmed? By the angle between its camera and the one that it is for."""

from collections.abc import Iterator

import pandas as pd

from anyview.analysis.cells import in_order
from anyview.analysis.comparisons import Methods
from anyview.analysis.estimates import Estimate, Estimator, proportion, tidy, without_interval
from anyview.analysis.study import EvaluatedMethod, Study

SUCCESS, DISTANCE, PLACED, LOST = "success_rate", "final_distance_median", "placed", "lost"
_WIDTH = 30  # degrees of a bin, around its multiples


def viewing(methods: Methods) -> dict[str, EvaluatedMethod]:
    """The methods whose clips are chosen by their angle, in the order of ``cells.in_order``."""
    return {cell: methods[cell] for cell in in_order(methods) if "angle" in methods[cell].runs}


def by_angle(methods: Methods, estimator: Estimator) -> pd.DataFrame:
    """``success_rate`` (Wilson) and ``final_distance_median`` of every method by angle.

    A table as ``estimates.tidy`` makes it. Its metrics begin with the angle in degrees, ``30.success_rate``,
    but for ``lost``: the share of runs that succeed at the smallest angle minus that at the largest, all runs
    of a context drawn together.
    """
    rows: list[tuple[str, str, Estimate]] = []
    for cell, method in viewing(methods).items():
        for angle, runs in method.runs.groupby("angle"):
            distances = runs["final_distance"].to_numpy(float)
            rows += [
                (cell, f"{angle:g}.runs", without_interval(len(runs))),
                (cell, f"{angle:g}.{SUCCESS}", proportion(int(runs["success"].sum()), len(runs))),
                (cell, f"{angle:g}.{DISTANCE}", estimator.median(f"{cell}/{angle:g}/{DISTANCE}", distances)),
            ]
        rows.append((cell, LOST, _lost(cell, method.runs, estimator)))
    return tidy(rows)


def placed_by_angle(study: Study, estimator: Estimator) -> pd.DataFrame:
    """``placed`` (see ``assessment.yardsticks``) of held-out real clips by the angle between both cameras.

    A table as of ``by_angle``, each clip at the nearest multiple of 30 degrees, the clips of a pair drawn
    together. It has rows where the study knows where cameras stood.
    """
    rows: list[tuple[str, str, Estimate]] = []
    for cell in filter(study.is_real, study.translators):
        clips = study.translators[cell].split("validation")
        for centre, members in angle_classes(clips, study.azimuths):
            values, pairs = members[PLACED].to_numpy(float), members["pair"].to_numpy()
            rows += [
                (cell, f"{centre:g}.clips", without_interval(len(members))),
                (cell, f"{centre:g}.{PLACED}", estimator.mean(f"{cell}/{centre:g}/{PLACED}", values, pairs)),
            ]
    return tidy(rows)


def angle_classes(clips: pd.DataFrame, azimuths: pd.Series) -> Iterator[tuple[float, pd.DataFrame]]:
    """Translated ``clips`` that have an object, by the nearest multiple of 30 degrees between both cameras.

    ``azimuths`` are degrees by clip, as ``Study`` has them.
    """
    angle = _between(clips["source"].map(azimuths), clips["clip"].map(azimuths))
    yield from clips[clips[PLACED].notna()].groupby(_WIDTH * (angle / _WIDTH).round())


def angles(table: pd.DataFrame, cell: str, metric: str) -> pd.DataFrame:
    """The rows of one method or translator and one metric, with a column ``angle`` in degrees."""
    parts = table["metric"].str.partition(".")
    chosen = (table["cell"] == cell) & (parts[2] == metric)
    return table[chosen].assign(angle=parts[0][chosen].astype(float))


def _between(one: pd.Series, other: pd.Series) -> pd.Series:
    """Degrees, 0 to 180, from azimuth to azimuth."""
    return ((one - other + 180) % 360 - 180).abs()


def _lost(cell: str, runs: pd.DataFrame, estimator: Estimator) -> Estimate:
    nearest, farthest = (runs[runs["angle"] == angle] for angle in (runs["angle"].min(), runs["angle"].max()))
    keys = [key for key in ("context", "choice") if key in runs]
    pairs = nearest.merge(farthest, on=keys, suffixes=("", "_farthest"), validate="one_to_one")
    lost = pairs["success"].to_numpy(float) - pairs["success_farthest"].to_numpy(float)
    return estimator.mean(f"{cell}/{LOST}", lost, pairs["context"].to_numpy())
