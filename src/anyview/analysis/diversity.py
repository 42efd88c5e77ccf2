"""How much diversity a translator needs: viewpoints, distractors and demonstrations, all combined."""

import json
import math
from collections.abc import Iterator
from functools import cache, partial
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pandas as pd

from anyview import paths
from anyview.analysis.comparisons import ENOUGH_RUNS, claimed, log_distance
from anyview.analysis.estimates import Estimator
from anyview.analysis.replicates import CONTRAST, by_context, contrast, corrected, rate, stacked
from anyview.analysis.statistics import sign_flip_test
from anyview.analysis.study import read_method
from anyview.config import Params
from anyview.runtime.errors import AnyviewError
from anyview.video.manifests import read_table
from anyview.video.splits import read_split

FACTORS = ("views", "clutter", "demonstrations")
_COLUMNS = ["evaluation", *FACTORS, "seed", "run", "success", "final_distance", "angle"]

ANGLES = (0.0, 11.25, 22.5, 45.0, 90.0, 135.0, 180.0)
"""Bounds of classes of angles in degrees. The first are as far as a context can be from 16, 8 and 4 views."""


def read_diversity(params: Params, root: Path = Path()) -> pd.DataFrame:
    """Runs below ``root`` of all that was evaluated, in the order of params.

    ``evaluation, views, clutter, demonstrations, seed, run, success, final_distance``; ``angle``: degrees
    from the agent's viewpoint to the nearest that its translator was trained on.
    """
    diversity = params.evidence.diversity
    trained_on = cache(partial(_trained_on, root))
    tables = []
    for evaluation, *factors, seed in product(
        paths.EVALUATIONS, diversity.views, paths.CLUTTER, diversity.demonstrations, diversity.seeds
    ):
        views, clutter, demonstrations = map(str, factors)
        dataset = paths.restricted_set(views, clutter)
        name = paths.replicate(f"{dataset}-{demonstrations}", seed, evaluation)
        folder = root / paths.policies(name)
        if not folder.exists():
            continue
        runs = read_method(folder).runs
        angles = nearest(_acting(folder), trained_on(dataset, int(demonstrations)))
        keys = dict(zip(_COLUMNS, (evaluation, views, clutter, demonstrations, seed), strict=False))
        tables.append(runs.assign(**keys, angle=angles[runs["run"].astype(int)])[_COLUMNS])
    return stacked(tables)


def nearest(azimuths: np.ndarray, views: np.ndarray) -> np.ndarray:
    """Degrees (n,) from each of ``azimuths`` (n,) to the nearest of ``views`` (m,), both in radians."""
    away = np.abs(azimuths[:, None] - views) % (2 * np.pi)
    return np.degrees(np.minimum(away, 2 * np.pi - away).min(axis=1))


def rates(runs: pd.DataFrame, estimator: Estimator) -> pd.DataFrame:
    """Each cell: ``evaluation, views, clutter, demonstrations``, then as ``replicates.rate`` has it."""
    rows = []
    for key, table in runs.groupby(["evaluation", *FACTORS], sort=False):
        found = rate(f"diversity/{key}", *by_context(table), estimator)
        rows.append(dict(zip(["evaluation", *FACTORS], key, strict=True)) | dict(found))
    return pd.DataFrame(rows)


def planned(params: Params) -> int:
    """How many evaluations there are to be."""
    return (
        len(paths.EVALUATIONS)
        * math.prod(map(len, levels(params).values()))
        * len(params.evidence.diversity.seeds)
    )


def levels(params: Params) -> dict[str, list[str]]:
    """The levels of each of ``FACTORS``, in order of diversity."""
    diversity = params.evidence.diversity
    views = [*map(str, diversity.views)]
    return dict(zip(FACTORS, (views, [*paths.CLUTTER], [*map(str, diversity.demonstrations)]), strict=True))


def effects(runs: pd.DataFrame, levels: dict[str, list[str]], estimator: Estimator) -> pd.DataFrame:
    """What the next of the ``levels`` of a factor changes, over all cells that differ in this factor alone.

    ``evaluation, factor, before, after``; ``pairs`` of translators; as ``replicates.contrast`` has it, of the
    level after; ``p``: sign-flip test of the pairs' mean log ratios, corrected for all rows but those of
    ``few`` pairs, which have none; ``claim``: more diversity ``helps``, ``harms``, or it is ``open``;
    ``few``: fewer than ``ENOUGH_RUNS`` pairs.
    """
    rows = []
    for evaluation, table in runs.groupby("evaluation", sort=False):
        for factor, before, after, success, logs in _steps(table, levels):
            rows.append(
                {
                    "evaluation": evaluation,
                    "factor": factor,
                    "before": before,
                    "after": after,
                    "pairs": len(logs),
                    **contrast(f"diversity/{evaluation}/{factor}/{after}", success, logs, estimator),
                    "p": sign_flip_test(logs.mean(axis=1)),
                }
            )
    table = pd.DataFrame(rows, columns=["evaluation", "factor", "before", "after", "pairs", *CONTRAST, "p"])
    table["p"] = corrected(table["p"], table["pairs"] >= ENOUGH_RUNS)
    return table.assign(claim=claimed(table, "pairs", "helps", "harms"))


def enough(effects: pd.DataFrame) -> pd.DataFrame:
    """Up to which level of each factor more of it helps: ``evaluation, factor, level, settled``.

    ``level`` is empty where no step helps. ``settled``: no later step has too few pairs to tell.
    """
    rows = []
    for (evaluation, factor), steps in effects.groupby(["evaluation", "factor"], sort=False):
        helps = np.flatnonzero(steps["claim"] == "helps")
        later = steps[helps[-1] + 1 if len(helps) else 0 :]
        level = steps["after"].iloc[helps[-1]] if len(helps) else ""
        rows.append((evaluation, factor, level, not (later["claim"] == "few").any()))
    return pd.DataFrame(rows, columns=["evaluation", "factor", "level", "settled"])


def angles(runs: pd.DataFrame) -> pd.DataFrame:
    """How runs end by the angle to the nearest viewpoint of the training: each class that has runs.

    ``evaluation, views, least, most`` (degrees), ``angle`` (their mean), ``runs``; ``success``, the share
    that succeeds; ``distance``, the geometric mean of the final ones in metres.
    """
    classes = np.digitize(runs["angle"].to_numpy(float), ANGLES[1:-1], right=True)
    rows = []
    for (evaluation, views, index), table in runs.assign(index=classes).groupby(
        ["evaluation", "views", "index"], sort=False
    ):
        distance = np.exp(log_distance(table["final_distance"]).mean())
        bounds = (ANGLES[index], ANGLES[index + 1], table["angle"].mean())
        rows.append((evaluation, views, *bounds, len(table), table["success"].mean(), distance))
    names = ["evaluation", "views", "least", "most", "angle", "runs", "success", "distance"]
    table = pd.DataFrame(rows, columns=names)
    order = table["views"].map({views: place for place, views in enumerate(runs["views"].unique())})
    return table.assign(order=order).sort_values(["evaluation", "order", "least"]).drop(columns="order")


def _steps(
    runs: pd.DataFrame, levels: dict[str, list[str]]
) -> Iterator[tuple[str, str, str, np.ndarray, np.ndarray]]:
    """Factor, level before and after; differences of successes and of logs, (pairs, contexts)."""
    for factor, ordered in levels.items():
        others = [name for name in (*FACTORS, "seed") if name != factor]
        for before, after in pairwise(ordered):
            wide = [
                runs[runs[factor] == level].pivot(index=others, columns="run") for level in (before, after)
            ]
            shared = wide[0].index.intersection(wide[1].index)
            if not len(shared):
                continue
            first, second = (table.loc[shared] for table in wide)
            success = second["success"].to_numpy(float) - first["success"].to_numpy(float)
            logs = log_distance(second["final_distance"]) - log_distance(first["final_distance"])
            yield factor, before, after, success, logs


def _acting(folder: Path) -> np.ndarray:
    """Azimuths of the contexts that the policies of ``folder`` act in, in radians."""
    path = folder / "policy.json"
    try:
        contexts = json.loads(path.read_text(encoding="utf-8"))["contexts"]
        return np.array([context["azimuth"] for context in contexts], float)
    except FileNotFoundError:
        raise AnyviewError(f"{path}: no such file") from None
    except (ValueError, KeyError, TypeError) as error:
        raise AnyviewError(f"{path}: not as policies are described: {error!r}") from None


def _trained_on(root: Path, dataset: str, demonstrations: int) -> np.ndarray:
    """Azimuths of the clips that the first so many ``demonstrations`` of a set train on, in radians."""
    manifest = read_table(root / paths.clip_set(dataset) / "manifest.csv", ["clip", "context"], unique="clip")
    split = read_split(root / paths.split_table(dataset))
    trained = set(split["clip"][split["split"] == "train"])
    first = manifest[:demonstrations]
    contexts = first["context"][first["clip"].isin(trained)]
    return np.array([json.loads(text)["azimuth"] for text in contexts], float)
