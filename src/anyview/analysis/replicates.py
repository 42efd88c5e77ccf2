"""Several translators of a cell: estimates over translators and contexts; figure 20 with several of each."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from anyview import paths
from anyview.analysis import thesis
from anyview.analysis.cells import OURS, ablation
from anyview.analysis.comparisons import SIGNIFICANT, TOLERANCE, log_distance
from anyview.analysis.estimates import Estimator
from anyview.analysis.statistics import exchange_test, holm
from anyview.analysis.study import read_method
from anyview.config import Params

ENOUGH_TRANSLATORS = 4
"""With fewer of a kind, not even a test of translators that all agree would reach 5%."""

BUDGETS = (1 / 4, 1 / 2, 1)
"""Parts of the training of policies after which the claims are judged."""


def read_replicates(params: Params, root: Path = Path()) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Runs and learning curves below ``root``, of the translators and rewards whose seeds are all there.

    Runs: ``reward, cell, seed, run, success, final_distance``; a ``cell`` is the method that the translator
    makes of `ours`. Curves: ``reward, cell, seed, run, iteration, final_distance``.
    """
    losses = params.evidence.losses
    runs, curves = [], []
    for reward in losses.every_reward:
        for translator in losses.translators:
            folders = {
                seed: root / paths.policies(paths.replicate(translator, seed, reward))
                for seed in losses.seeds_under(reward)
            }
            for seed, folder in folders.items() if all(map(Path.exists, folders.values())) else ():
                method, keys = (
                    read_method(folder),
                    {"reward": reward, "cell": ablation(translator), "seed": seed},
                )
                runs.append(method.runs[["run", "success", "final_distance"]].assign(**keys))
                curves.append(method.curve[["run", "iteration", "final_distance"]].assign(**keys))
    return stacked(runs), stacked(curves)


def rates(runs: pd.DataFrame, estimator: Estimator) -> pd.DataFrame:
    """Each cell under each reward, over its translators and the contexts.

    ``reward, cell``, then as ``rate`` has it, and the success rate of the ``thesis``.
    """
    rows = []
    for reward, cell, success, logs in _tables(runs):
        published = thesis.SUCCESSES.get(cell, np.nan) / thesis.RUNS
        found = rate(f"{reward}/{cell}", success, logs, estimator)
        rows.append({"reward": reward, "cell": cell, **found, "thesis": published})
    return pd.DataFrame(rows)


def ablations(runs: pd.DataFrame, estimator: Estimator) -> pd.DataFrame:
    """Each ablation against `ours` under the same reward.

    ``reward, cell, translators``, then as ``contrast`` has it; ``thesis``: its difference of success rates;
    ``p``: exact test that exchanges the two cells' translators, of their mean log distances, corrected for
    all rows but those of ``few`` translators, which have none; ``claim``, that the loss helps: ``supported``,
    ``refuted`` (it harms), ``open`` or ``few``.
    """
    tables = {(reward, cell): values for reward, cell, *values in _tables(runs)}
    rows = []
    for (reward, cell), (success, logs) in tables.items():
        if cell == OURS or (reward, OURS) not in tables:
            continue
        our_success, our_logs = tables[reward, OURS]
        rows.append(
            {
                "reward": reward,
                "cell": cell,
                "translators": len(logs),
                **contrast(f"{reward}/{cell}", success - our_success, logs - our_logs, estimator),
                "thesis": (thesis.SUCCESSES.get(cell, np.nan) - thesis.SUCCESSES[OURS]) / thesis.RUNS,
                "p": exchange_test(logs.mean(axis=1), our_logs.mean(axis=1)),
            }
        )
    table = pd.DataFrame(rows, columns=["reward", "cell", "translators", *CONTRAST, "thesis", "p"])
    table["p"] = corrected(table["p"], table["translators"] >= ENOUGH_TRANSLATORS)
    return table.assign(claim=[_claim(row) for row in table.itertuples()])


def claims(curves: pd.DataFrame, estimator: Estimator, steps: int) -> pd.DataFrame:
    """What can be said of each loss after the ``BUDGETS`` of environment steps: ``ablations``, and ``steps``.

    An iteration has ``steps`` of a run. The tests of each budget are corrected by themselves.
    """
    points = np.unique(curves["iteration"])
    reached = {points[np.searchsorted(points, part * points[-1], "right").clip(1) - 1] for part in BUDGETS}
    tables = []
    for iteration in sorted(reached):
        runs = curves[curves["iteration"] == iteration]
        runs = runs.assign(success=runs["final_distance"] < TOLERANCE)
        tables.append(ablations(runs, estimator).assign(steps=iteration * steps))
    return pd.concat(tables, ignore_index=True)


def verdicts(claims: pd.DataFrame) -> pd.DataFrame:
    """``reward, cell, thesis`` of the ``claims``; ``claims``: that of each number of steps, a tuple."""
    rows = claims.groupby(["reward", "cell"], sort=False).agg(
        thesis=("thesis", "first"), claims=("claim", tuple)
    )
    return rows.reset_index()


def learning(curves: pd.DataFrame, steps: int) -> pd.DataFrame:
    """Geometric mean of the final distance of the policies so far: ``reward, cell, steps, final_distance``.

    Over translators and contexts, in metres; an iteration has ``steps`` environment steps of a run.
    """
    logs = curves.assign(log=log_distance(curves["final_distance"]), steps=curves["iteration"] * steps)
    means = logs.groupby(["reward", "cell", "steps"], sort=False)["log"].mean()
    return np.exp(means).rename("final_distance").reset_index()


CONTRAST = ("value", "low", "high", "ratio", "ratio_low", "ratio_high")


def rate(name: str, success: np.ndarray, logs: np.ndarray, estimator: Estimator) -> Mapping[str, float]:
    """Successes and log distances of one cell, both (translators, contexts).

    ``translators, contexts``; ``value, low, high`` of the success rate, ``fewest, most`` successes of one
    translator; ``distance, distance_low, distance_high``: geometric mean of the final distances, in metres.
    """
    found = estimator.crossed_mean(f"{name}/success", success)
    distance = estimator.crossed_mean(f"{name}/distance", logs).exponential()
    counts = success.sum(axis=1).astype(int)
    return {
        "translators": success.shape[0],
        "contexts": success.shape[1],
        "value": found.value,
        "low": found.low,
        "high": found.high,
        "fewest": counts.min(),
        "most": counts.max(),
        "distance": distance.value,
        "distance_low": distance.low,
        "distance_high": distance.high,
    }


def contrast(name: str, success: np.ndarray, logs: np.ndarray, estimator: Estimator) -> Mapping[str, float]:
    """Differences of successes and of log distances of two cells, both (translators, contexts).

    ``value, low, high``: difference of success rates; ``ratio, ratio_low, ratio_high``: how many times as
    far, as a geometric mean.
    """
    found = estimator.crossed_mean(f"{name}/success difference", success)
    ratio = estimator.crossed_mean(f"{name}/ratio", logs).exponential()
    values = (found.value, found.low, found.high, ratio.value, ratio.low, ratio.high)
    return dict(zip(CONTRAST, values, strict=True))


def corrected(p_values: pd.Series, enough: pd.Series) -> np.ndarray:
    """Holm's correction of the ``p_values`` of which there are ``enough``; the others are not tested: NaN."""
    found, tested = p_values.to_numpy(float, copy=True), enough.to_numpy(bool)
    found[~tested] = np.nan
    found[tested] = holm(found[tested])
    return found


def stacked(tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """The ``tables``, one below another; an empty one where there are none."""
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()


def by_context(runs: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Successes and log distances of one cell's ``runs``, both (translators, contexts)."""
    wide = runs.pivot(index="seed", columns="run", values=["success", "final_distance"])
    return wide["success"].to_numpy(float), log_distance(wide["final_distance"])


def _tables(runs: pd.DataFrame) -> Iterator[tuple[str, str, np.ndarray, np.ndarray]]:
    """Reward, cell, successes and log distances, both (translators, contexts)."""
    for (reward, cell), table in runs.groupby(["reward", "cell"], sort=False):
        yield reward, cell, *by_context(table)


def _claim(row: Any) -> str:
    if row.translators < ENOUGH_TRANSLATORS:
        return "few"
    if row.p >= SIGNIFICANT:
        return "open"
    return "supported" if row.ratio > 1 else "refuted"
