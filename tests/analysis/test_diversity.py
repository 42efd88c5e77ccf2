"""How much diversity: what was put in comes out, and a claim needs pairs of translators that agree."""

from itertools import product

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from anyview.analysis.diversity import angles, effects, enough, leaving, nearest, points, rates
from anyview.analysis.statistics import holm

LEVELS = {"views": ["1", "4", "any"], "clutter": ["plain", "distractors"], "demonstrations": ["250", "4000"]}
CONTEXTS = 15


def runs_of(metres, seeds=(1, 2), evaluation="diverse", noise: float = 0.2) -> pd.DataFrame:
    """Runs of the whole design; ``metres(views, clutter, demonstrations)`` is where a cell ends."""
    rng = np.random.default_rng(0)
    luck = rng.normal(0, 0.4, CONTEXTS)
    tables = []
    for *factors, seed in product(*LEVELS.values(), seeds):
        distance = metres(*factors) * np.exp(rng.normal(0, noise) + luck + rng.normal(0, noise, CONTEXTS))
        keys = dict(zip(LEVELS, factors, strict=True)) | {"evaluation": evaluation, "seed": seed}
        angle = np.linspace(0, {"1": 180, "4": 45, "any": 1}[factors[0]], CONTEXTS)
        columns = {"run": range(CONTEXTS), "success": distance < 0.02, "final_distance": distance}
        tables.append(pd.DataFrame(columns | {"angle": angle}).assign(**keys))
    return pd.concat(tables, ignore_index=True)


def by_views(views: str, clutter: str, demonstrations: str) -> float:
    """Only one view is too few; without distractors it gets a little better."""
    return (0.3 if views == "1" else 0.02) * (1.5 if clutter == "distractors" else 1)


def test_what_is_worse_better_and_neither_is_told_apart():
    table = effects(runs_of(by_views), LEVELS).set_index(["factor", "level"])
    assert table["claim"].to_dict() == {
        ("views", "1"): "worse",
        ("views", "4"): "open",
        ("clutter", "plain"): "better",
        ("demonstrations", "250"): "open",
    }
    assert list(table["pairs"]) == [8, 8, 12, 12]
    assert table["ratio"]["views", "1"] == pytest.approx(0.3 / 0.02, rel=0.3)
    assert table["value"]["views", "1"] < 0
    found = enough(table.reset_index()).set_index("factor")
    assert found["worse"].to_dict() == {"views": ("1",), "clutter": (), "demonstrations": ()}
    assert [other.level for other in found["others"]["views"]] == ["4"]


def test_where_all_else_fails_an_effect_shows_with_the_most_of_the_rest():
    """With one view nothing works, whatever the demonstrations: they matter where views are many."""
    runs = runs_of(lambda views, _, count: 0.5 if views == "1" or count == "250" else 0.01, noise=0.0)
    row = effects(runs, LEVELS).set_index(["factor", "level"]).loc["demonstrations", "250"]
    assert row["rest"] == pytest.approx(50)
    assert row["ratio"] == pytest.approx(50 ** (2 / 3))  # of three levels of views one does not change
    alone = runs[runs["clutter"] == "plain"]
    assert np.isnan(effects(alone, LEVELS)["rest"]).all()


def test_in_contexts_of_the_training_demonstrations_alone_are_compared():
    own = runs_of(lambda views, *_: 0.3 if views == "any" else 0.01, evaluation="own")
    assert set(effects(own, LEVELS)["factor"]) == {"demonstrations"}
    assert enough(effects(own, LEVELS)).empty
    assert angles(own, LEVELS).empty
    assert points(own, LEVELS).empty


def test_what_leaving_the_training_costs_is_of_the_same_translators_and_scenes():
    own = runs_of(lambda *_: 0.01, evaluation="own", noise=0.0)
    there = runs_of(lambda views, *_: 0.03 if views == "1" else 0.01, noise=0.0)
    table = leaving(pd.concat([own, there])).set_index(["views", "clutter"])
    np.testing.assert_allclose(table["ratio"]["1"], 3)
    np.testing.assert_allclose(table["ratio"]["any"], 1)
    assert (table["own"] == own["success"].mean()).all()
    assert set(table["translators"]) == {4}
    assert leaving(own).empty


def test_ratio_and_test_are_of_pairs_that_differ_in_one_factor_alone():
    """Against loops and scipy's permutation test."""
    runs = runs_of(by_views)
    logs = runs.assign(log=np.log(runs["final_distance"].clip(lower=0.001)))
    means = logs.groupby([*LEVELS, "seed"])["log"].mean()
    table = effects(runs, LEVELS)
    plain = []
    for row in table.itertuples():
        others = [values for name, values in LEVELS.items() if name != row.factor]
        differences = []
        for *rest, seed in product(*others, (1, 2)):
            place = list(LEVELS).index(row.factor)
            at = [tuple([*rest[:place], level, *rest[place:], seed]) for level in (row.level, row.most)]
            differences.append(means[at[0]] - means[at[1]])
        assert row.ratio == pytest.approx(np.exp(np.mean(differences)))
        test = stats.permutation_test(
            (differences,), np.mean, permutation_type="samples", vectorized=True, n_resamples=np.inf
        )
        plain.append(test.pvalue)
    np.testing.assert_allclose(table["p"], holm(np.array(plain)))


def test_pairs_that_are_not_there_yet_are_left_out_and_few_carry_no_claim():
    table = effects(runs_of(by_views, seeds=(1,)), LEVELS)
    found = table.set_index(["factor", "level"])
    assert found["claim"]["views", "1"] == "few"  # 4 pairs
    assert np.isnan(found["p"]["views", "1"])  # so that it takes nothing from the others' tests
    assert enough(table).set_index("factor")["others"]["views"][0].claim == "few"
    runs = runs_of(by_views)
    missing = (runs["views"] == "1") & (runs["clutter"] == "plain") & (runs["seed"] == 2)
    rest = effects(runs[~missing], LEVELS)
    assert list(rest["pairs"]) == [6, 8, 10, 11]
    assert rest["claim"][0] == "few"
    alone = effects(runs[runs["views"] == "1"], LEVELS)
    assert set(alone["factor"]) == {"clutter", "demonstrations"}


def test_a_translator_of_bad_luck_is_no_effect():
    """One of eight is bad, with all of its runs: certain over runs, open over translators."""
    runs = runs_of(lambda *factors: 0.02)
    bad = (runs["views"] == "4") & (runs["clutter"] == "plain") & (runs["seed"] == 2)
    runs.loc[bad & (runs["demonstrations"] == "250"), "final_distance"] *= 20
    table = effects(runs, LEVELS)
    assert set(table["claim"]) == {"open"}


def test_rates_are_over_translators_and_contexts():
    runs = runs_of(by_views)
    table = rates(runs).set_index(list(LEVELS))
    cell = runs[(runs["views"] == "1") & (runs["clutter"] == "plain") & (runs["demonstrations"] == "250")]
    row = table.loc["1", "plain", "250"]
    assert (row["translators"], row["contexts"]) == (2, CONTEXTS)
    assert row["distance"] == pytest.approx(stats.gmean(cell["final_distance"].clip(lower=0.001)))
    assert row["distance_low"] < row["distance"] < row["distance_high"]


def test_the_nearest_view_is_found_across_the_seam():
    rng = np.random.default_rng(0)
    azimuths, views = rng.uniform(-np.pi, np.pi, 50), rng.uniform(-np.pi, np.pi, 7)
    cosines = np.cos(azimuths)[:, None] * np.cos(views) + np.sin(azimuths)[:, None] * np.sin(views)
    np.testing.assert_allclose(nearest(azimuths, views), np.degrees(np.arccos(cosines.max(1))), atol=1e-5)
    assert nearest(np.array([3.1]), np.array([-3.1])) == pytest.approx(np.degrees(2 * np.pi - 6.2))


def test_classes_of_angles_hold_every_run_once():
    runs = runs_of(by_views)
    table = angles(runs, LEVELS)
    assert table["runs"].sum() == len(runs)
    assert list(dict.fromkeys(table["views"])) == ["1", "4", "any"]
    for row in table.itertuples():
        inside = runs[(runs["views"] == row.views) & (runs["angle"] <= row.most)]
        inside = inside[(inside["angle"] > row.least) | ((row.least == 0) & (inside["angle"] == 0))]
        assert (row.runs, row.contexts) == (len(inside), inside["run"].nunique())
        assert row.success == pytest.approx(inside["success"].mean())
        assert row.distance == pytest.approx(stats.gmean(inside["final_distance"].clip(lower=0.001)))


def test_hard_contexts_do_not_pass_for_an_effect_of_the_angle():
    """Every run ends three times as far as with any view, whatever its context does to both."""
    runs = runs_of(lambda views, *_: 0.09 if views == "1" else 0.03, noise=0.0)
    table = angles(runs, LEVELS).set_index("views")
    assert table.loc["1", "distance"].max() > 1.3 * table.loc["1", "distance"].min()
    np.testing.assert_allclose(table.loc["1", "ratio"], 3)
    np.testing.assert_allclose(points(runs, LEVELS).set_index("views").loc["1", "ratio"], 3)
    assert angles(runs[runs["views"] == "1"], LEVELS)["ratio"].isna().all()
