"""Do rewards follow progress, and do failures earn less than successes? From scripted rollouts, by method."""

from collections.abc import Iterator

import numpy as np
import pandas as pd
from scipy import stats

from anyview.analysis.cells import in_order
from anyview.analysis.estimates import Estimate, Estimator, tidy
from anyview.analysis.study import Rankings

GOOD = "good"
REFUSED, ORDER = "refused", "value_order"


def ranked(rankings: Rankings | None, estimator: Estimator) -> pd.DataFrame:
    """A table as ``estimates.tidy`` makes it. Contexts are resampled, each with all of its rollouts.

    - ``value_order``: Spearman's correlation of the values of a good rollout's frames with their time
      (value-order correlation, Ma et al. 2024), mean over runs;
    - ``refused.<kind>``: of all pairs of a failed rollout of the kind and a good one in the same run, those
      in which the failed one earns less;
    - ``refused``: the mean of these over the kinds.
    """
    return tidy(_ranked(rankings, estimator) if rankings else ())


def failures(table: pd.DataFrame) -> list[str]:
    """The kinds of failures in the table of ``ranked``, in their order."""
    kinds = table["metric"][table["metric"].str.startswith(f"{REFUSED}.")]
    return list(kinds.str.removeprefix(f"{REFUSED}.").unique())


def _ranked(rankings: Rankings, estimator: Estimator) -> Iterator[tuple[str, str, Estimate]]:
    for cell in in_order(rankings.rollouts["cell"].unique()):
        values = rankings.values[rankings.values["cell"] == cell]
        orders = values.groupby(["context", "run"])[["step", "value"]].apply(_order)
        contexts = orders.index.get_level_values("context").to_numpy()
        yield cell, ORDER, estimator.mean(f"{cell}/{ORDER}", orders.to_numpy(float), contexts)
        shares = _shares(rankings.rollouts[rankings.rollouts["cell"] == cell])
        contexts = shares.index.get_level_values("context").to_numpy()
        yield cell, REFUSED, estimator.mean(f"{cell}/{REFUSED}", shares.mean(axis=1).to_numpy(), contexts)
        for kind in shares:
            found = estimator.mean(f"{cell}/{REFUSED}/{kind}", shares[kind].to_numpy(), contexts)
            yield cell, f"{REFUSED}.{kind}", found


def _order(values: pd.DataFrame) -> float:
    """Spearman's correlation of value and step; 0 where all values are the same."""
    if values["value"].nunique() == 1:
        return 0.0
    return float(stats.spearmanr(values["value"], values["step"]).statistic)


def _shares(rollouts: pd.DataFrame) -> pd.DataFrame:
    """Share of pairs in which the failed one earns less: a row for each context and run, a column a kind."""
    returns = (
        rollouts.groupby(["context", "run", "kind"], sort=False)["return"].apply(np.array).unstack("kind")
    )
    kinds = [kind for kind in rollouts["kind"].unique() if kind != GOOD]
    pairs = {
        kind: [
            float((failed[:, None] < good).mean())
            for failed, good in zip(returns[kind], returns[GOOD], strict=True)
        ]
        for kind in kinds
    }
    return pd.DataFrame(pairs, index=returns.index)
