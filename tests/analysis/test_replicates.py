"""Several translators of each loss: what was put in comes out, and a claim needs translators that agree."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from anyview import paths
from anyview.analysis.estimates import Estimator
from anyview.analysis.replicates import BUDGETS, ablations, claims, learning, rates, read_replicates, verdicts
from anyview.analysis.statistics import holm

SEEDS, CONTEXTS = 6, 15
ESTIMATOR = Estimator(1)


def runs_of(
    translators: dict[str, np.ndarray], reward: str = "raw", contexts: int = CONTEXTS
) -> pd.DataFrame:
    """Runs around a distance for each translator (metres), with the luck of contexts and of runs."""
    rng = np.random.default_rng(0)
    luck = rng.normal(0, 0.4, contexts)
    rows = []
    for cell, typical in translators.items():
        for seed, metres in enumerate(typical):
            distances = metres * np.exp(luck + rng.normal(0, 0.3, contexts))
            rows += [
                {
                    "reward": reward,
                    "cell": cell,
                    "seed": seed,
                    "run": run,
                    "success": distance < 0.02,
                    "final_distance": distance,
                }
                for run, distance in enumerate(distances)
            ]
    return pd.DataFrame(rows)


def lucky(metres: float, spread: float, seed: int = 0, count: int = SEEDS) -> np.ndarray:
    return metres * np.exp(np.random.default_rng(seed).normal(0, spread, count))


def test_a_loss_whose_translators_all_end_farther_is_supported():
    runs = runs_of({"ours": lucky(0.01, 0.2), "no-translation": lucky(0.05, 0.2, 1)})
    (row,) = ablations(runs, ESTIMATOR).itertuples()
    assert (row.claim, row.translators) == ("supported", SEEDS)
    assert row.ratio_low < row.ratio < row.ratio_high
    assert row.p == pytest.approx(
        2 / 924
    )  # no other way of dealing out twelve is as far apart, but its mirror
    assert row.thesis == pytest.approx((7 - 12) / 15)
    better = runs_of({"ours": lucky(0.05, 0.2), "no-translation": lucky(0.01, 0.2, 1)})
    assert list(ablations(better, ESTIMATOR)["claim"]) == ["refuted"]


def test_one_bad_translator_is_luck_though_its_runs_agree():
    """All 15 runs of one translator miss by half a metre: certain over runs, open over translators."""
    bad = lucky(0.01, 0.2, 1)
    bad[0] = 0.5
    (row,) = ablations(runs_of({"ours": lucky(0.01, 0.2), "no-alignment": bad}), ESTIMATOR).itertuples()
    assert row.claim == "open"
    assert row.ratio_low < 1 < row.ratio_high


def test_the_contrasts_of_both_rewards_are_corrected_together():
    cells = {
        "ours": lucky(0.01, 0.3),
        "no-alignment": lucky(0.014, 0.3, 1),
        "no-translation": lucky(0.02, 0.3, 2),
    }
    runs = pd.concat([runs_of(cells), runs_of(cells, "normalised")])
    table = ablations(runs, ESTIMATOR)
    logs = runs.assign(log=np.log(runs["final_distance"].clip(lower=0.001)))
    means = logs.groupby(["reward", "cell", "seed"])["log"].mean()
    plain = np.array(
        [
            stats.permutation_test(
                (means[row.reward, row.cell].to_numpy(), means[row.reward, "ours"].to_numpy()),
                lambda x, y: x.mean() - y.mean(),
                vectorized=False,
            ).pvalue
            for row in table.itertuples()
        ]
    )
    np.testing.assert_allclose(table["p"], holm(plain))


def test_few_translators_carry_no_claim():
    runs = runs_of({"ours": lucky(0.01, 0.0, count=3), "no-alignment": lucky(0.5, 0.0, count=3)})
    (row,) = ablations(runs, ESTIMATOR).itertuples()
    assert row.claim == "few"
    assert np.isnan(row.p)  # so that it takes nothing from the others' tests


def test_rates_count_over_translators_and_contexts():
    runs = runs_of({"ours": np.array([0.001, 0.001, 0.5])})
    (row,) = rates(runs, ESTIMATOR).itertuples()
    assert (row.translators, row.contexts, row.fewest, row.most) == (3, CONTEXTS, 0, CONTEXTS)
    assert row.value == pytest.approx(2 / 3)
    assert (row.low, row.high) == (0.0, 1.0)  # three translators: all drawn may be the bad one, or none
    assert row.thesis == 0.8
    assert row.distance == pytest.approx(stats.gmean(runs["final_distance"].clip(lower=0.001)))


def test_an_interval_is_as_wide_as_translators_and_contexts_make_it():
    """Against the standard error of a mean with two crossed random effects."""
    rng = np.random.default_rng(0)
    translators, contexts = rng.normal(0, 1.0, (30, 1)), rng.normal(0, 2.0, (1, 40))
    found = ESTIMATOR.crossed_mean("x", 5 + translators + contexts)
    error = np.sqrt(translators.var() / 30 + contexts.var() / 40)
    assert found.value == pytest.approx((5 + translators + contexts).mean())
    assert found.high - found.low == pytest.approx(2 * 1.96 * error, rel=0.05)


def test_one_translator_is_drawn_every_time():
    values = np.random.default_rng(0).normal(0, 1, 200)
    crossed, plain = ESTIMATOR.crossed_mean("x", values[None]), ESTIMATOR.mean("x", values)
    assert crossed.high - crossed.low == pytest.approx(plain.high - plain.low, rel=0.05)


def test_only_what_has_all_of_its_seeds_is_read(data, params):
    evidence = params.evidence.losses
    for seed in evidence.seeds:
        data.policies(paths.replicate("sim", seed, "raw"), 0.03)
        data.policies(paths.replicate("sim-no-alignment", seed, "raw"), 0.3)
    data.policies(paths.replicate("sim", 1, "normalised"), 0.03)
    for seed in evidence.others.seeds:
        data.policies(paths.replicate("sim", seed, "raw-tenth"), 0.03)
    runs, curves = read_replicates(params, data.root)
    assert runs.groupby(["reward", "cell"])["seed"].unique().map(list).to_dict() == {
        ("raw", "ours"): evidence.seeds,
        ("raw", "no-alignment"): evidence.seeds,
        ("raw-tenth", "ours"): evidence.others.seeds,
    }
    assert len(runs) == 15 * (2 * len(evidence.seeds) + len(evidence.others.seeds))
    table = learning(curves, 49)
    assert set(table["steps"]) == {49 * iteration for iteration in curves["iteration"]}
    assert (table.groupby("cell")["final_distance"].last().loc[["ours", "no-alignment"]] > 0.001).all()


def test_a_claim_is_judged_after_each_budget_by_the_curves():
    """Without the loss policies are as good at first, and stay behind."""
    cells = {"ours": lucky(0.01, 0.2), "no-translation": lucky(0.012, 0.2, 1)}
    early = runs_of(cells | {"no-translation": lucky(0.01, 0.2)}).assign(iteration=10)
    late = runs_of(cells | {"no-translation": lucky(0.1, 0.2, 1)}).assign(iteration=40)
    table = claims(pd.concat([early, late]).drop(columns="success"), ESTIMATOR, 49)
    assert list(table["steps"]) == [490, 1960]  # a quarter and a half are both the first point
    assert len(BUDGETS) == 3
    assert list(table["claim"]) == ["open", "supported"]
    expected = ablations(late, ESTIMATOR)
    assert table["p"].iloc[1] == expected["p"].iloc[0]
    (row,) = verdicts(table).itertuples()
    assert (row.cell, row.claims) == ("no-translation", ("open", "supported"))


def test_where_nothing_was_run_there_are_no_runs(params, tmp_path):
    assert all(table.empty for table in read_replicates(params, tmp_path))
