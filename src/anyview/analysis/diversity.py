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
from anyview.analysis.comparisons import claimed, log_distance
from anyview.analysis.replicates import CONTRAST, by_context, contrast, corrected, rate, read_whole, stacked
from anyview.analysis.statistics import sign_flip_test
from anyview.config import Params
from anyview.diversity.sets import chosen
from anyview.runtime.errors import AnyviewError
from anyview.video.manifests import read_table
from anyview.video.splits import read_split

FACTORS = ("views", "clutter", "demonstrations")
_COLUMNS = ["evaluation", *FACTORS, "seed", "run", "success", "final_distance", "angle"]

ANYWHERE = "diverse"
"""The evaluation in any context by any clip: contexts are the same for all translators."""

ANGLES = (0.0, 22.5, 45.0, 90.0, 180.0)
"""Bounds of classes of angles in degrees. The first are as far as a context can be from 8 and 4 views."""

ENOUGH_PAIRS = 8
"""With fewer pairs of translators not even such as all agree would reach 5% beside the other rows."""


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
        runs = read_whole(folder, diversity.iterations).runs
        angles = nearest(_acting(folder), trained_on(dataset, int(demonstrations), seed))
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

    ``evaluation, factor, level, most``; ``pairs`` of translators; as ``replicates.contrast`` has it, of the
    level against the most diverse, averaged over the other factors; ``rest``: the same ratio where the other
    factors have the most, NaN where that was not run; ``p``: sign-flip test of the pairs' mean log ratios,
    corrected for all rows but those of ``few`` pairs, which have none; ``claim``: less diversity is
    ``worse``, ``better``, or it is ``open``; ``few``: fewer than ``ENOUGH_PAIRS``. Where contexts are as
    those of the training, only cells that act in the same ones are compared: of other demonstrations.
    """
    rows = []
    for evaluation, table in runs.groupby("evaluation", sort=False):
        for factor in FACTORS if evaluation == ANYWHERE else ("demonstrations",):
            for level, pairs in _pairs(table, factor, levels):
                logs = np.stack(pairs["logs"])
                rest = _at_most(pairs, levels, factor)["logs"]
                rows.append(
                    {
                        "evaluation": evaluation,
                        "factor": factor,
                        "level": level,
                        "most": levels[factor][-1],
                        "pairs": len(logs),
                        **contrast(np.stack(pairs["success"]), logs),
                        "rest": np.exp(np.mean(np.stack(rest))) if len(rest) else np.nan,
                        "p": sign_flip_test(logs.mean(axis=1)),
                    }
                )
    names = ["evaluation", "factor", "level", "most", "pairs", *CONTRAST, "rest", "p"]
    table = pd.DataFrame(rows, columns=names)
    table.loc[table["pairs"] < ENOUGH_PAIRS, "p"] = np.nan
    table["p"] = corrected(table["p"])
    return table.assign(claim=claimed(table, "pairs", "better", "worse", ENOUGH_PAIRS))


def leaving(runs: pd.DataFrame) -> pd.DataFrame:
    """What it costs to leave what a translator was trained on: ``views, clutter``, the same translators.

    ``translators``; ``own, diverse``: success rates; as ``replicates.contrast`` has it, of any context by any
    clip against contexts and clips as trained on, scene by scene. Only of cells that have both.
    """
    wide = runs.pivot(
        index=["views", "clutter", "demonstrations", "seed"],
        columns=["evaluation", "run"],
        values=["success", "final_distance"],
    ).dropna()
    rows = []
    both = {"own", ANYWHERE} <= set(runs["evaluation"])
    for (views, clutter), table in wide.groupby(["views", "clutter"], sort=False) if both else ():
        success, metres = table["success"], table["final_distance"]
        logs = log_distance(metres[ANYWHERE]) - log_distance(metres["own"])
        found = contrast((success[ANYWHERE] - success["own"]).to_numpy(float), logs)
        shares = {name: success[name].to_numpy(float).mean() for name in ("own", ANYWHERE)}
        rows.append({"views": views, "clutter": clutter, "translators": len(table), **shares, **found})
    return pd.DataFrame(rows, columns=["views", "clutter", "translators", "own", ANYWHERE, *CONTRAST])


def enough(effects: pd.DataFrame) -> pd.DataFrame:
    """Levels of each factor that are worse than the most in any context: ``factor, most, worse, others``.

    ``worse`` is a tuple of levels; ``others`` are rows of ``effects`` that are not, and what is not tested.
    """
    rows = []
    for factor, levels in effects[effects["evaluation"] == ANYWHERE].groupby("factor", sort=False):
        worse = tuple(levels["level"][levels["claim"] == "worse"])
        others = [row for row in levels.itertuples() if row.claim != "worse"]
        rows.append((factor, levels["most"].iloc[0], worse, others))
    return pd.DataFrame(rows, columns=["factor", "most", "worse", "others"])


def angles(runs: pd.DataFrame, levels: dict[str, list[str]]) -> pd.DataFrame:
    """How runs in any context end by the angle to the nearest viewpoint of the training: a row a class.

    ``views, least, most`` (degrees), ``angle`` (their mean), ``runs``, ``contexts`` that they are in;
    ``success``, the share that succeeds; ``distance``, the geometric mean of the final ones in metres;
    ``ratio``, how many times as far as with the most viewpoints in these very contexts, NaN where that was
    not run: some contexts are harder than others. Classes without runs have no row.
    """
    logs = _beside_most(runs, levels)
    classes = np.digitize(logs["angle"].to_numpy(float), ANGLES[1:-1], right=True)
    rows = []
    for (views, index), table in logs.assign(index=classes).groupby(["views", "index"], sort=False):
        bounds = (ANGLES[index], ANGLES[index + 1], table["angle"].mean())
        counts = (len(table), table["run"].nunique(), table["success"].mean())
        ends = (np.exp(table["log"].mean()), np.exp(table["beside"].mean()))
        rows.append((views, *bounds, *counts, *ends))
    names = ["views", "least", "most", "angle", "runs", "contexts", "success", "distance", "ratio"]
    table = pd.DataFrame(rows, columns=names)
    order = table["views"].map(levels["views"].index)
    return table.assign(order=order).sort_values(["order", "least"]).drop(columns="order")


def points(runs: pd.DataFrame, levels: dict[str, list[str]]) -> pd.DataFrame:
    """``views, run, angle, ratio`` as ``angles`` has them, of every context by itself.

    Of fewer viewpoints than the most, where this one was run.
    """
    logs = _beside_most(runs, levels).dropna(subset="beside")
    fewer = logs[logs["views"] != levels["views"][-1]]
    means = fewer.groupby(["views", "run"], sort=False)[["angle", "beside"]].mean()
    return means.assign(ratio=np.exp(means["beside"])).drop(columns="beside").reset_index()


def _beside_most(runs: pd.DataFrame, levels: dict[str, list[str]]) -> pd.DataFrame:
    """Runs in any context with their ``log`` distance, and ``beside`` that with the most viewpoints."""
    runs = runs[runs["evaluation"] == ANYWHERE]
    logs = runs.assign(log=log_distance(runs["final_distance"]))
    keys = ["clutter", "demonstrations", "seed", "run"]
    most = logs.loc[logs["views"] == levels["views"][-1], [*keys, "log"]]
    logs = logs.merge(most, on=keys, how="left", suffixes=("", "_most"))
    return logs.assign(beside=logs["log"] - logs["log_most"])


def _pairs(
    runs: pd.DataFrame, factor: str, levels: dict[str, list[str]]
) -> Iterator[tuple[str, pd.DataFrame]]:
    """Each level but the most, with a row for each pair of translators: ``FACTORS`` and ``seed``, ``success,
    logs``: differences, (contexts,)."""
    others = [name for name in (*FACTORS, "seed") if name != factor]
    *less, most = levels[factor]
    wide = {level: runs[runs[factor] == level].pivot(index=others, columns="run") for level in levels[factor]}
    for level in less:
        shared = wide[level].index.intersection(wide[most].index)
        if len(shared):
            here, there = wide[level].loc[shared], wide[most].loc[shared]
            success = here["success"].to_numpy(float) - there["success"].to_numpy(float)
            logs = log_distance(here["final_distance"]) - log_distance(there["final_distance"])
            yield level, shared.to_frame(index=False).assign(success=list(success), logs=list(logs))


def _at_most(pairs: pd.DataFrame, levels: dict[str, list[str]], factor: str) -> pd.DataFrame:
    """Those of the ``pairs`` whose other factors have the most."""
    others = [name for name in FACTORS if name != factor]
    return pairs[np.logical_and.reduce([pairs[name] == levels[name][-1] for name in others])]


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


def _trained_on(root: Path, dataset: str, demonstrations: int, seed: int) -> np.ndarray:
    """Azimuths of the clips that a training of ``seed`` learns from, in radians."""
    manifest = read_table(root / paths.clip_set(dataset) / "manifest.csv", ["clip", "context"], unique="clip")
    split = read_split(root / paths.split_table(dataset))
    trained = set(split["clip"][split["split"] == "train"])
    contexts = manifest["context"][
        chosen(len(manifest), demonstrations, seed) & manifest["clip"].isin(trained)
    ]
    return np.array([json.loads(text)["azimuth"] for text in contexts], float)
