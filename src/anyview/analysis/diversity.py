"""How much diversity a translator needs: viewpoints, distractors and demonstrations, all combined."""

import json
import math
from collections.abc import Iterator
from functools import cache, partial
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from anyview import paths
from anyview.analysis.comparisons import ENOUGH_RUNS, claimed, log_distance
from anyview.analysis.replicates import CONTRAST, by_context, contrast, corrected, rate, read_whole, stacked
from anyview.analysis.statistics import sign_flip_test
from anyview.config import Params
from anyview.runtime.errors import AnyviewError
from anyview.video.manifests import read_table
from anyview.video.splits import read_split

FACTORS = ("views", "clutter", "demonstrations")
_COLUMNS = ["evaluation", *FACTORS, "seed", "run", "success", "final_distance", "angle"]

ANYWHERE = "diverse"
"""The evaluation in any context by any clip: contexts are the same for all translators."""

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
        runs = read_whole(folder, params.imitation.iterations).runs
        angles = nearest(_acting(folder), trained_on(dataset, int(demonstrations)))
        keys = dict(zip(_COLUMNS, (evaluation, views, clutter, demonstrations, seed), strict=False))
        tables.append(runs.assign(**keys, angle=angles[runs["run"].astype(int)])[_COLUMNS])
    return stacked(tables)


def nearest(azimuths: np.ndarray, views: np.ndarray) -> np.ndarray:
    """Degrees (n,) from each of ``azimuths`` (n,) to the nearest of ``views`` (m,), both in radians."""
    away = np.abs(azimuths[:, None] - views) % (2 * np.pi)
    return np.degrees(np.minimum(away, 2 * np.pi - away).min(axis=1))


def rates(runs: pd.DataFrame) -> pd.DataFrame:
    """Each cell: ``evaluation, views, clutter, demonstrations``, then as ``replicates.rate`` has it."""
    rows = []
    for key, table in runs.groupby(["evaluation", *FACTORS], sort=False):
        found = rate(*by_context(table))
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


def effects(runs: pd.DataFrame, levels: dict[str, list[str]]) -> pd.DataFrame:
    """What each level of a factor lacks that the most diverse has: cells that differ in this factor alone.

    Of runs in any context, the same ones at every level. ``factor, level, most``; ``pairs`` of translators;
    as ``replicates.contrast`` has it, of the level against the most diverse; ``p``: sign-flip test of the
    pairs' mean log ratios, corrected for all rows but those of ``few`` pairs, which have none; ``claim``:
    less diversity is ``worse``, ``better``, or it is ``open``; ``few``: fewer than ``ENOUGH_RUNS`` pairs.
    """
    rows = []
    for factor, level, most, success, logs in _pairs(runs[runs["evaluation"] == ANYWHERE], levels):
        keys = {"factor": factor, "level": level, "most": most, "pairs": len(logs)}
        rows.append({**keys, **contrast(success, logs), "p": sign_flip_test(logs.mean(axis=1))})
    table = pd.DataFrame(rows, columns=["factor", "level", "most", "pairs", *CONTRAST, "p"])
    table.loc[table["pairs"] < ENOUGH_RUNS, "p"] = np.nan
    table["p"] = corrected(table["p"])
    return table.assign(claim=claimed(table, "pairs", "better", "worse"))


def enough(effects: pd.DataFrame) -> pd.DataFrame:
    """How much of each factor is seen to be needed: ``factor, level, most``.

    The first level from which on none is worse than the most diverse; empty where a later one has too few
    pairs to tell.
    """
    rows = []
    for factor, levels in effects.groupby("factor", sort=False):
        falling = np.flatnonzero(levels["claim"].isin(["worse", "few"]))
        most = levels["most"].iloc[0]
        after = [*levels["level"], most][falling[-1] + 1 if len(falling) else 0]
        rows.append((factor, "" if (levels["claim"] == "few").any() else after, most))
    return pd.DataFrame(rows, columns=["factor", "level", "most"])


def angles(runs: pd.DataFrame, levels: dict[str, list[str]]) -> pd.DataFrame:
    """How runs in any context end by the angle to the nearest viewpoint of the training: a row a class.

    ``views, least, most`` (degrees), ``angle`` (their mean), ``runs``, ``contexts`` that they are in;
    ``success``, the share that succeeds; ``distance``, the geometric mean of the final ones in metres;
    ``ratio``, how many times as far as with the most viewpoints in these very contexts, NaN where that was
    not run: some contexts are harder than others. Classes without runs have no row.
    """
    runs = runs[runs["evaluation"] == ANYWHERE]
    logs = runs.assign(log=log_distance(runs["final_distance"]))
    keys = ["clutter", "demonstrations", "seed", "run"]
    most = logs.loc[logs["views"] == levels["views"][-1], [*keys, "log"]]
    logs = logs.merge(most, on=keys, how="left", suffixes=("", "_most"))
    classes = np.digitize(logs["angle"].to_numpy(float), ANGLES[1:-1], right=True)
    rows = []
    for (views, index), table in logs.assign(index=classes).groupby(["views", "index"], sort=False):
        bounds = (ANGLES[index], ANGLES[index + 1], table["angle"].mean())
        counts = (len(table), table["run"].nunique(), table["success"].mean())
        ends = (np.exp(table["log"].mean()), np.exp((table["log"] - table["log_most"]).mean()))
        rows.append((views, *bounds, *counts, *ends))
    names = ["views", "least", "most", "angle", "runs", "contexts", "success", "distance", "ratio"]
    table = pd.DataFrame(rows, columns=names)
    order = table["views"].map(levels["views"].index)
    return table.assign(order=order).sort_values(["order", "least"]).drop(columns="order")


def _pairs(
    runs: pd.DataFrame, levels: dict[str, list[str]]
) -> Iterator[tuple[str, str, str, np.ndarray, np.ndarray]]:
    """Factor, a level and the most diverse; differences of successes and of logs, (pairs, contexts)."""
    for factor, (*less, most) in levels.items():
        others = [name for name in (*FACTORS, "seed") if name != factor]
        wide = {
            level: runs[runs[factor] == level].pivot(index=others, columns="run") for level in (*less, most)
        }
        for level in less:
            shared = wide[level].index.intersection(wide[most].index)
            if not len(shared):
                continue
            here, there = wide[level].loc[shared], wide[most].loc[shared]
            success = here["success"].to_numpy(float) - there["success"].to_numpy(float)
            yield (
                factor,
                level,
                most,
                success,
                log_distance(here["final_distance"]) - log_distance(there["final_distance"]),
            )


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
