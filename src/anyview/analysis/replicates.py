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
from anyview.analysis.estimates import crossed_mean, crossed_rate
from anyview.analysis.statistics import exchange_test, holm
from anyview.analysis.study import EvaluatedMethod, read_method
from anyview.config import Params, RewardWeights
from anyview.runtime.errors import AnyviewError

ENOUGH_TRANSLATORS = 5
"""With fewer of a kind, not even translators that all agree would reach 5% beside three other losses."""

BUDGETS = (1 / 4, 1 / 2, 1)
"""Parts of the training of policies after which the claims are judged."""


def read_replicates(params: Params, root: Path = Path()) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Runs and learning curves below ``root``, of the translators and rewards whose seeds are all there.

    Runs: ``reward, cell, seed, run, success, final_distance, return_still``; a ``cell`` is the method that
    the translator makes of `ours`. Curves: ``reward, cell, seed, run, iteration, final_distance``.
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
                method = read_whole(folder, losses.iterations)
                keys = {"reward": reward, "cell": ablation(translator), "seed": seed}
                columns = ["run", "success", "final_distance", "return_still"]
                runs.append(method.runs[columns].assign(**keys))
                curves.append(method.curve[["run", "iteration", "final_distance"]].assign(**keys))
    return stacked(runs), stacked(curves)


def read_whole(folder: Path, iterations: int) -> EvaluatedMethod:
    """The method in ``folder``; AnyviewError unless its policies learned for so many ``iterations``."""
    method = read_method(folder)
    if (learned := int(method.curve["iteration"].max())) != iterations:
        says = f"its policies learned for {learned} iterations, where params.yaml says {iterations}"
        raise AnyviewError(f"{folder}: {says}: run its stage again")
    return method


def rates(runs: pd.DataFrame) -> pd.DataFrame:
    """Each cell under each reward, over its translators and the contexts.

    ``reward, cell``, then as ``rate`` has it, and the success rate of the ``thesis``.
    """
    rows = []
    for reward, cell, success, logs in _tables(runs):
        published = thesis.SUCCESSES.get(cell, np.nan) / thesis.RUNS
        rows.append({"reward": reward, "cell": cell, **rate(success, logs), "thesis": published})
    return pd.DataFrame(rows)


def shares(runs: pd.DataFrame, rewards: Mapping[str, RewardWeights]) -> pd.DataFrame:
    """How much of a raw reward is L_f, by what standing still costs: ``reward, cell, share``.

    Of the raw among the ``rewards``, where runs of one that is not raw tell the cost of L_f: standing still
    earns -T u_f (w_f + w_i) / w_f there, on the equations' scale, and -T (u_f + phi u_i) under a raw one.
    Shares are medians over translators and contexts.
    """
    still = runs.pivot(index=["cell", "seed", "run"], columns="reward", values="return_still")
    told = [name for name in still if not rewards[name].raw and rewards[name].feature]
    rows = []
    for name in still if told else ():
        if rewards[name].raw and rewards[name].feature:
            weights = rewards[told[0]]
            features = still[told[0]] * weights.feature / (weights.feature + weights.image)
            found = (features / still[name]).dropna().groupby("cell", sort=False).median()
            rows += [(name, cell, share) for cell, share in found.items()]
    return pd.DataFrame(rows, columns=["reward", "cell", "share"])


def ablations(runs: pd.DataFrame) -> pd.DataFrame:
    """Each ablation against `ours` under the same reward.

    ``reward, cell, translators``, then as ``contrast`` has it; ``thesis``: its difference of success rates;
    ``p``: exact test that exchanges the two cells' translators, of their mean log distances, corrected for
    the rows of one reward; those of ``few`` translators have none; ``claim``, that the loss helps:
    ``supported``, ``refuted`` (it harms), ``open`` or ``few``.
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
                **contrast(success - our_success, logs - our_logs),
                "thesis": (thesis.SUCCESSES.get(cell, np.nan) - thesis.SUCCESSES[OURS]) / thesis.RUNS,
                "p": exchange_test(logs.mean(axis=1), our_logs.mean(axis=1)),
            }
        )
    table = pd.DataFrame(rows, columns=["reward", "cell", "translators", *CONTRAST, "thesis", "p"])
    table.loc[table["translators"] < ENOUGH_TRANSLATORS, "p"] = np.nan
    table["p"] = table.groupby("reward")["p"].transform(corrected)
    return table.assign(claim=[_claim(row) for row in table.itertuples()])


def claims(curves: pd.DataFrame, steps: int) -> pd.DataFrame:
    """What can be said of each loss after the ``BUDGETS`` of environment steps: ``ablations``, and ``steps``.

    An iteration has ``steps`` of a run. The tests of each budget are corrected by themselves.
    """
    points = np.unique(curves["iteration"])
    reached = {points[np.searchsorted(points, part * points[-1], "right").clip(1) - 1] for part in BUDGETS}
    tables = []
    for iteration in sorted(reached):
        runs = curves[curves["iteration"] == iteration]
        runs = runs.assign(success=runs["final_distance"] < TOLERANCE)
        tables.append(ablations(runs).assign(steps=iteration * steps))
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


CONTRAST = ("value", "ratio", "ratio_low", "ratio_high")


def rate(success: np.ndarray, logs: np.ndarray) -> Mapping[str, float]:
    """Successes and log distances of one cell, both (translators, contexts).

    ``translators, contexts``; ``value, low, high`` of the success rate, ``fewest, most`` successes of one
    translator; ``distance, distance_low, distance_high``: geometric mean of the final distances, in metres;
    ``nearest, farthest`` of one translator.
    """
    found, distance = crossed_rate(success), crossed_mean(logs).exponential()
    counts, of_translators = success.sum(axis=1).astype(int), np.exp(logs.mean(axis=1))
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
        "nearest": of_translators.min(),
        "farthest": of_translators.max(),
    }


def contrast(success: np.ndarray, logs: np.ndarray) -> Mapping[str, float]:
    """Differences of successes and of log distances of two cells, both (translators, contexts).

    ``value``: difference of success rates; ``ratio, ratio_low, ratio_high``: how many times as far, as a
    geometric mean.
    """
    ratio = crossed_mean(logs).exponential()
    values = (float(success.mean()), ratio.value, ratio.low, ratio.high)
    return dict(zip(CONTRAST, values, strict=True))


def corrected(p_values: pd.Series) -> np.ndarray:
    """Holm's correction of those ``p_values`` that are not NaN, which was not tested."""
    found = p_values.to_numpy(float, copy=True)
    tested = ~np.isnan(found)
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
