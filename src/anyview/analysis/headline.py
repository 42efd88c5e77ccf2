"""The study's main methods, each with several models: how they end, over models and contexts."""

from pathlib import Path

import numpy as np
import pandas as pd

from anyview import paths
from anyview.analysis import thesis
from anyview.analysis.cells import OURS
from anyview.analysis.replicates import CONTRAST, by_context, contrast, rate, read_whole, stacked
from anyview.analysis.statistics import holm, sign_flip_test
from anyview.config import Params


def read_headline(params: Params, root: Path = Path()) -> pd.DataFrame:
    """Runs below ``root`` of the methods whose seeds are all there.

    ``cell, seed, run, success, final_distance``.
    """
    headline = params.evidence.headline
    runs = []
    for cell in headline.cells:
        folders = {
            seed: root / paths.policies(paths.replicate(paths.headline(cell), seed))
            for seed in headline.seeds
        }
        if all(folder.exists() for folder in folders.values()):
            runs += [
                read_whole(folder, headline.iterations)
                .runs[["run", "success", "final_distance"]]
                .assign(cell=cell, seed=seed)
                for seed, folder in folders.items()
            ]
    return stacked(runs)


def rates(runs: pd.DataFrame) -> pd.DataFrame:
    """Each method: ``cell``, then as ``replicates.rate`` has it, and the success rate of the ``thesis``."""
    rows = []
    for cell, table in runs.groupby("cell", sort=False):
        published = thesis.SUCCESSES.get(str(cell), np.nan) / thesis.RUNS
        rows.append({"cell": cell, **rate(*by_context(table)), "thesis": published})
    return pd.DataFrame(rows)


def against_ours(runs: pd.DataFrame) -> pd.DataFrame:
    """Every other method against `ours`, in the same contexts.

    ``cell``, then as ``replicates.contrast`` has it; ``farther``: models with which the object ends farther
    away than with those of `ours` in the mean; ``p``: sign-flip test over contexts of the mean log ratio of
    these models, corrected for all rows. It says nothing of other models, of which there are too few to test;
    the intervals are of those too.
    """
    tables = {cell: by_context(table) for cell, table in runs.groupby("cell", sort=False)}
    rows = []
    for cell, (success, logs) in tables.items() if OURS in tables else ():
        if cell == OURS:
            continue
        our_success, our_logs = tables[OURS]
        differences = logs - our_logs
        rows.append(
            {
                "cell": cell,
                "models": len(logs),
                **contrast(success - our_success, differences),
                "farther": (logs.mean(axis=1) > our_logs.mean()).sum(),
                "p": sign_flip_test(differences.mean(axis=0)),
            }
        )
    table = pd.DataFrame(rows, columns=["cell", "models", *CONTRAST, "farther", "p"])
    return table.assign(p=holm(table["p"].to_numpy(float)))
