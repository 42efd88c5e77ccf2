"""Several translators of each loss: what was put in comes out, and a claim needs translators that agree."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from anyview import paths
from anyview.analysis.replicates import (
    BUDGETS,
    ablations,
    claims,
    learning,
    rates,
    read_replicates,
    shares,
    verdicts,
)
from anyview.analysis.statistics import holm
from anyview.config import RewardWeights
from anyview.runtime.errors import AnyviewError

SEEDS, CONTEXTS = 6, 15


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
    (row,) = ablations(runs).itertuples()
    assert (row.claim, row.translators) == ("supported", SEEDS)
    assert row.ratio_low < row.ratio < row.ratio_high
    assert row.p == pytest.approx(
        2 / 924
    )  # no other way of dealing out twelve is as far apart, but its mirror
    assert row.thesis == pytest.approx((7 - 12) / 15)
    better = runs_of({"ours": lucky(0.05, 0.2), "no-translation": lucky(0.01, 0.2, 1)})
    assert list(ablations(better)["claim"]) == ["refuted"]


def test_one_bad_translator_is_luck_though_its_runs_agree():
    """All 15 runs of one translator miss by half a metre: certain over runs, open over translators."""
    bad = lucky(0.01, 0.2, 1)
    bad[0] = 0.5
    (row,) = ablations(runs_of({"ours": lucky(0.01, 0.2), "no-alignment": bad})).itertuples()
    assert row.claim == "open"
    assert row.ratio_low < 1 < row.ratio_high


def test_the_contrasts_of_one_reward_are_corrected_together():
    cells = {
        "ours": lucky(0.01, 0.3),
        "no-alignment": lucky(0.014, 0.3, 1),
        "no-translation": lucky(0.02, 0.3, 2),
    }
    runs = pd.concat([runs_of(cells), runs_of(cells, "normalised")])
    table = ablations(runs)
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
    np.testing.assert_allclose(table["p"], np.concatenate([holm(plain[:2]), holm(plain[2:])]))


def test_few_translators_carry_no_claim():
    runs = runs_of({"ours": lucky(0.01, 0.0, count=3), "no-alignment": lucky(0.5, 0.0, count=3)})
    (row,) = ablations(runs).itertuples()
    assert row.claim == "few"
    assert np.isnan(row.p)  # so that it takes nothing from the others' tests


def test_rates_count_over_translators_and_contexts():
    runs = runs_of({"ours": np.array([0.001, 0.001, 0.5])})
    (row,) = rates(runs).itertuples()
    assert (row.translators, row.contexts, row.fewest, row.most) == (3, CONTEXTS, 0, CONTEXTS)
    assert row.value == pytest.approx(2 / 3)
    assert row.low < 0.05 < 0.95 < row.high  # three translators, one of which is bad: it may be any share
    assert row.nearest < 0.01 < 0.3 < row.farthest
    assert row.thesis == 0.8
    assert row.distance == pytest.approx(stats.gmean(runs["final_distance"].clip(lower=0.001)))


def still(**costs: float) -> pd.DataFrame:
    """Runs of four translators in which standing still costs so much under each reward."""
    tables = [
        pd.DataFrame({"seed": np.arange(4), "run": 0, "return_still": -cost}).assign(reward=name, cell="ours")
        for name, cost in costs.items()
    ]
    return pd.concat(tables)


def test_the_part_of_features_in_a_raw_reward_is_found_from_what_standing_still_costs():
    """u_f = 3 and u_i = 7, of which normalised rewards know the first alone."""
    weights = {
        "normalised": RewardWeights(feature=1.0, image=0.5),
        "raw": RewardWeights(feature=1.0, image=1.0, raw=True),
        "raw-tenfold": RewardWeights(feature=1.0, image=10.0, raw=True),
    }
    runs = still(**{"normalised": 3 * 1.5, "raw": 3 + 7, "raw-tenfold": 3 + 70})
    table = shares(runs, weights).set_index("reward")["share"]
    assert table["raw"] == pytest.approx(0.3)
    assert table["raw-tenfold"] == pytest.approx(3 / 73)
    assert shares(runs[runs["reward"] != "normalised"], weights).empty


def test_only_what_has_all_of_its_seeds_is_read(data, params):
    evidence, last = params.evidence.losses, params.evidence.losses.iterations
    for seed in evidence.seeds:
        data.policies(paths.replicate("sim", seed, "raw"), 0.03, last=last)
        data.policies(paths.replicate("sim-no-alignment", seed, "raw"), 0.3, last=last)
    data.policies(paths.replicate("sim", 1, "normalised"), 0.03, last=last)
    for seed in evidence.others.seeds:
        data.policies(paths.replicate("sim", seed, "raw-tenth"), 0.03, last=last)
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


def test_policies_of_another_budget_are_not_mixed_with_those_of_params(data, params):
    for seed in params.evidence.losses.seeds:
        data.policies(paths.replicate("sim", seed, "raw"), 0.03, last=90)
    told = rf"sim-seed-1-raw.*for 90 iterations, where params.yaml says {params.evidence.losses.iterations}"
    with pytest.raises(AnyviewError, match=told):
        read_replicates(params, data.root)


def test_a_claim_is_judged_after_each_budget_by_the_curves():
    """Without the loss policies are as good at first, and stay behind."""
    cells = {"ours": lucky(0.01, 0.2), "no-translation": lucky(0.012, 0.2, 1)}
    early = runs_of(cells | {"no-translation": lucky(0.01, 0.2)}).assign(iteration=10)
    late = runs_of(cells | {"no-translation": lucky(0.1, 0.2, 1)}).assign(iteration=40)
    table = claims(pd.concat([early, late]).drop(columns="success"), 49)
    assert list(table["steps"]) == [490, 1960]  # a quarter and a half are both the first point
    assert len(BUDGETS) == 3
    assert list(table["claim"]) == ["open", "supported"]
    expected = ablations(late)
    assert table["p"].iloc[1] == expected["p"].iloc[0]
    (row,) = verdicts(table).itertuples()
    assert (row.cell, row.claims) == ("no-translation", ("open", "supported"))


def test_where_nothing_was_run_there_are_no_runs(params, tmp_path):
    assert all(table.empty for table in read_replicates(params, tmp_path))
