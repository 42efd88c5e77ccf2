"""The main methods with several models: pairs of one seed and context; the interval draws models."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from anyview import paths
from anyview.analysis.headline import against_ours, rates, read_headline


def runs_of(**metres: list[float]) -> pd.DataFrame:
    """Runs in 15 contexts, around a distance for each model of a cell."""
    rng = np.random.default_rng(0)
    luck = rng.normal(0, 0.4, 15)
    tables = []
    for cell, of_models in metres.items():
        for seed, typical in enumerate(of_models):
            distance = typical * np.exp(luck + rng.normal(0, 0.2, 15))
            columns = {"run": range(15), "success": distance < 0.02, "final_distance": distance}
            tables.append(pd.DataFrame(columns).assign(cell=cell, seed=seed))
    return pd.concat(tables, ignore_index=True)


def test_models_that_all_end_nearer_do_so_and_the_test_is_over_contexts():
    runs = runs_of(ours=[0.01, 0.02, 0.03], oracle=[0.005, 0.0105, 0.0145], tcn=[0.005, 0.01, 0.3])
    table = against_ours(runs).set_index("cell")
    assert table.loc["oracle", ["farther", "models"]].tolist() == [0, 3]
    assert table["farther"]["tcn"] == 1
    assert table["ratio"]["oracle"] == pytest.approx(0.5, rel=0.2)
    assert table["ratio_high"]["oracle"] < 1
    assert table["ratio_low"]["tcn"] < 1 < table["ratio_high"]["tcn"]  # one model decides
    logs = np.log(runs.pivot(index=["cell", "seed"], columns="run", values="final_distance"))
    of_models = (logs.loc["oracle"] - logs.loc["ours"]).mean()
    plain = stats.permutation_test(
        (of_models,), np.mean, permutation_type="samples", vectorized=True, n_resamples=np.inf
    )
    assert table["p"]["oracle"] == pytest.approx(2 * plain.pvalue)  # the smaller of two


def test_without_ours_there_is_nothing_to_compare_with():
    runs = runs_of(oracle=[0.01, 0.02])
    assert against_ours(runs).empty
    assert list(rates(runs)["translators"]) == [2]


def test_only_what_has_all_of_its_seeds_is_read(data, params):
    headline = params.evidence.headline
    seeds, last = headline.seeds, headline.iterations
    for seed in seeds:
        data.policies(paths.replicate(paths.headline("ours"), seed), 0.03, last=last)
    data.policies(paths.replicate(paths.headline("liu"), seeds[0]), 0.3, last=last)
    runs = read_headline(params, data.root)
    assert set(runs["cell"]) == {"ours"}
    assert len(runs) == 15 * len(seeds)
    (row,) = rates(runs).itertuples()
    assert row.thesis == 0.8


def test_where_nothing_was_run_there_are_no_runs(params, tmp_path):
    assert read_headline(params, tmp_path).empty
