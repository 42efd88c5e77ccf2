"""Figure 20 with several translators of each loss: what a loss does, over translators and contexts."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from anyview import paths
from anyview.analysis import thesis
from anyview.analysis.cells import OURS, ablation
from anyview.analysis.comparisons import SIGNIFICANT, log_distance
from anyview.analysis.estimates import Estimator
from anyview.analysis.statistics import exchange_test, holm
from anyview.analysis.study import read_method
from anyview.config import Params
from anyview.runtime.errors import AnyviewError

ENOUGH_TRANSLATORS = 4
"""With fewer of a kind, not even a test of translators that all agree would reach 5%."""


def read_replicates(params: Params, root: Path = Path()) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Runs and learning curves below ``root``, of the translators and rewards whose seeds are all there.

    Runs: ``reward, cell, seed, run, success, final_distance``; a ``cell`` is the method that the translator
    makes of `ours`. Curves: ``reward, cell, seed, run, iteration, final_distance``. Raises AnyviewError if
    there are none.
    """
    evidence = params.evidence
    runs, curves = [], []
    for reward in evidence.rewards:
        for translator in evidence.translators:
            folders = {
                seed: root / paths.policies(paths.replicate(translator, seed, reward))
                for seed in evidence.seeds
            }
            for seed, folder in folders.items() if all(map(Path.exists, folders.values())) else ():
                method, keys = (
                    read_method(folder),
                    {"reward": reward, "cell": ablation(translator), "seed": seed},
                )
                runs.append(method.runs[["run", "success", "final_distance"]].assign(**keys))
                curves.append(method.curve[["run", "iteration", "final_distance"]].assign(**keys))
    if not runs:
        raise AnyviewError(f"{root / paths.DATA}: no translator is evaluated with all of its seeds yet")
    return pd.concat(runs, ignore_index=True), pd.concat(curves, ignore_index=True)


def rates(runs: pd.DataFrame, estimator: Estimator) -> pd.DataFrame:
    """Each cell under each reward, over its translators and the contexts.

    ``reward, cell, translators, contexts``; ``value, low, high`` of the success rate, ``fewest, most``
    successes of one translator, ``thesis``; ``distance, distance_low, distance_high``: geometric mean of the
    final distances, in metres.
    """
    rows = []
    for reward, cell, success, logs in _tables(runs):
        rate = estimator.crossed_mean(f"{reward}/{cell}/success", success)
        distance = estimator.crossed_mean(f"{reward}/{cell}/distance", logs).exponential()
        counts = success.sum(axis=1).astype(int)
        published = thesis.SUCCESSES.get(cell, np.nan) / thesis.RUNS
        estimates = (rate.value, rate.low, rate.high, counts.min(), counts.max(), published)
        rows.append((reward, cell, *success.shape, *estimates, distance.value, distance.low, distance.high))
    names = ["reward", "cell", "translators", "contexts", "value", "low", "high", "fewest", "most", "thesis"]
    return pd.DataFrame(rows, columns=[*names, "distance", "distance_low", "distance_high"])


def ablations(runs: pd.DataFrame, estimator: Estimator) -> pd.DataFrame:
    """Each ablation against `ours` under the same reward.

    ``reward, cell``; ``value, low, high``: difference of success rates; ``thesis``: its own; ``ratio,
    ratio_low, ratio_high``: how many times as far, as a geometric mean; ``p``: exact test that exchanges the
    two cells' translators, of their mean log distances, corrected for all rows; ``claim``, that the loss
    helps: ``supported``, ``refuted`` (it harms), ``open`` or ``few``.
    """
    tables = {(reward, cell): values for reward, cell, *values in _tables(runs)}
    rows = []
    for (reward, cell), (success, logs) in tables.items():
        if cell == OURS or (reward, OURS) not in tables:
            continue
        our_success, our_logs = tables[reward, OURS]
        rate = estimator.crossed_mean(f"{reward}/{cell}/success difference", success - our_success)
        ratio = estimator.crossed_mean(f"{reward}/{cell}/ratio", logs - our_logs).exponential()
        published = (thesis.SUCCESSES.get(cell, np.nan) - thesis.SUCCESSES[OURS]) / thesis.RUNS
        p = exchange_test(logs.mean(axis=1), our_logs.mean(axis=1))
        estimates = (rate.value, rate.low, rate.high, published, ratio.value, ratio.low, ratio.high, p)
        rows.append((reward, cell, len(logs), *estimates))
    names = ["reward", "cell", "translators", "value", "low", "high", "thesis"]
    table = pd.DataFrame(rows, columns=[*names, "ratio", "ratio_low", "ratio_high", "p"])
    table["p"] = holm(table["p"].to_numpy(float))
    return table.assign(claim=[_claim(row) for row in table.itertuples()])


def learning(curves: pd.DataFrame, steps: int) -> pd.DataFrame:
    """Geometric mean of the final distance of the policies so far: ``reward, cell, steps, final_distance``.

    Over translators and contexts, in metres; an iteration has ``steps`` environment steps of a run.
    """
    logs = curves.assign(log=log_distance(curves["final_distance"]), steps=curves["iteration"] * steps)
    means = logs.groupby(["reward", "cell", "steps"], sort=False)["log"].mean()
    return np.exp(means).rename("final_distance").reset_index()


def _tables(runs: pd.DataFrame) -> Iterator[tuple[str, str, np.ndarray, np.ndarray]]:
    """Reward, cell, successes and log distances, both (translators, contexts)."""
    for (reward, cell), table in runs.groupby(["reward", "cell"], sort=False):
        wide = table.pivot(index="seed", columns="run", values=["success", "final_distance"])
        yield reward, cell, wide["success"].to_numpy(float), log_distance(wide["final_distance"])


def _claim(row: Any) -> str:
    if row.translators < ENOUGH_TRANSLATORS:
        return "few"
    if row.p >= SIGNIFICANT:
        return "open"
    return "supported" if row.ratio > 1 else "refuted"
