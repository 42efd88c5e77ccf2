import copy
import math
import random
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from string import ascii_lowercase as LETTERS
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anyview.config import Params, load_params, parse_params, read_yaml
from anyview.runtime.errors import AnyviewError

PARAMS = Path(__file__).parents[1] / "params.yaml"
VALUES = read_yaml(PARAMS)


def leaves(tree: Any, path: tuple[str, ...] = ()):
    if isinstance(tree, dict):
        for key, branch in tree.items():
            yield from leaves(branch, (*path, key))
    else:
        yield path


LEAVES = list(leaves(VALUES))


def changed(path: tuple[str, ...], value: Any) -> dict:
    values = copy.deepcopy(VALUES)
    branch = values
    for key in path[:-1]:
        branch = branch[key]
    branch[path[-1]] = value
    return values


def refusal(read: Callable[[], Params]) -> str | None:
    """What a user would be told, in one line; None where the params are sound."""
    try:
        assert isinstance(read(), Params)
    except AnyviewError as error:
        said = str(error)
    else:
        return None
    assert "\n" not in said
    return said


def test_the_committed_params_are_sound():
    params = load_params(PARAMS)
    assert params.base.seed == VALUES["base"]["seed"]
    assert params.imitation.cells.keys() == VALUES["imitation"]["cells"].keys()


def test_a_method_and_its_oracle_differ_by_the_reward_alone():
    params = load_params(PARAMS)
    beyond, cells = params.beyond.cells, params.imitation.cells
    pairs = [(beyond[name], beyond[f"{name}-oracle"]) for name in beyond if f"{name}-oracle" in beyond]
    assert pairs
    for method, oracle in [*pairs, (cells["ours"], cells["oracle"])]:
        assert oracle == method.model_copy(update={"reward": "true"})


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        ("base.seed", -1, "base.seed: Input should be greater than or equal to 0, got -1"),
        ("base.sead", 1, "base.sead: unknown key"),
        (
            "imitation.cells.ours.model",
            "nosuch",
            "imitation.cells.ours.model: 'nosuch' is none of these: real-adam, ",
        ),
        (
            "imitation.cells.ours.model",
            "tcn",
            "imitation.cells.ours.model: 'tcn' is none of these: real-adam",
        ),
        ("imitation.cells.tcn.model", "sim", "imitation.cells.tcn.model: 'sim' is none of these: tcn"),
        ("imitation.dataset", "real", "imitation.dataset: 'real' is none of these: diverse, narrow"),
        (
            "translators.sim.dataset",
            "wide",
            "translators.sim.dataset: 'wide' is none of these: diverse, narrow",
        ),
        ("split.wide", {"validation": 0.1}, "split.wide: 'wide' is none of these: diverse, narrow, real"),
        (
            "beyond.cells.choice.model",
            "tcn",
            "beyond.cells.choice.model: 'tcn' is none of these: real-adam, ",
        ),
        (
            "beyond.translators.sim-choice.dataset",
            "real",
            "beyond.translators.sim-choice.dataset: 'real' is none of these: diverse, narrow, choice",
        ),
        (
            "beyond.translators.sim-human.experts",
            "choice",
            "beyond.translators.sim-human.experts: 'choice' is none of these: real, rendered",
        ),
        (
            "beyond.translators.sim-human.pretraining.dataset",
            "diverse",
            "beyond.translators.sim-human.pretraining.dataset: 'diverse' is none of these: real, rendered",
        ),
        (
            "beyond.translators.sim-human.augment",
            True,
            "beyond.translators.sim-human.augment: other experts' clips are not augmented, and paired with ",
        ),
        (
            "beyond.cells.human.experts",
            "choice",
            "beyond.cells.human.experts: 'choice' is none of these: diverse, real",
        ),
        (
            "beyond.cells.human.own_clips",
            True,
            "beyond.cells.human.experts: other experts' clips are the same for every context, and no clock's",
        ),
        (
            "beyond.translators.sim-human.dataset",
            "reach",
            "beyond.translators.sim-human.dataset: 'reach' is none of these: diverse, narrow",
        ),
        (
            "beyond.cells.human-xirl.model",
            "sim",
            "beyond.cells.human-xirl.model: 'sim' is none of these: xirl",
        ),
        ("beyond.cells.human-xirl.time_power", 1.0, "beyond.cells.human-xirl.time_power: unknown key"),
        (
            "beyond.cells.human-xirl.reward",
            "nearest",
            "beyond.cells.human-xirl.reward: Input should be 'translated', 'true', 'clock' or 'goal'",
        ),
        (
            "beyond.embeddings.xirl.experts",
            "rendered",
            "beyond.embeddings.xirl.experts: 'rendered' is none of these: diverse, real",
        ),
        ("beyond.embeddings.xirl.clips", 5, "beyond.embeddings.xirl.clips: Input should be a multiple of 2"),
        (
            "beyond.embeddings.tcn",
            VALUES["beyond"]["embeddings"]["xirl"],
            "beyond.embeddings.tcn: the name is taken by translators or embeddings",
        ),
        (
            "beyond.sets.wide",
            {"task": "push", "contexts": "choice", "demos": 4},
            "beyond.split.wide: missing key",
        ),
        (
            "beyond.cells.angles.own_clips",
            False,
            "beyond.cells.angles.angles: chosen for each context's own camera, which needs own_clips",
        ),
        (
            "beyond.cells.choice-tempo.time_power",
            2.0,
            "beyond.cells.choice-tempo.time_power: must be 0 where clips are matched by transport",
        ),
        (
            "beyond.cells.choice-tempo.incomplete",
            {"every": 2},
            "beyond.cells.choice-tempo.incomplete: clips matched by transport have all their frames",
        ),
        (
            "beyond.ranking.methods",
            ["ours", "choice-tempo"],
            "beyond.ranking.methods: 'choice-tempo' is none",
        ),
        (
            "beyond.cells.reach.experts",
            "real",
            "beyond.cells.reach.dataset: 'reach' is none of these: diverse",
        ),
        (
            "beyond.translators.sim-human.dataset",
            "tempo",
            "beyond.translators.sim-human.dataset: 'tempo' is none",
        ),
        (
            "imitation.ddpg.replay",
            48,
            "imitation.ddpg.replay: 48 steps are less than an iteration's 1 episodes",
        ),
        (
            "translators.sim.weights.places",
            1.0,
            "translators.sim.weights.places: compact has no keypoints to teach places",
        ),
        ("beyond.cells.angles.angles", [30, 30], "beyond.cells.angles.angles: one is listed twice"),
        (
            "beyond.ranking.methods",
            ["ours", "sim"],
            "beyond.ranking.methods: 'sim' is none of these: ours, liu, narrow-ddpg",
        ),
        ("beyond.cells.clock.own_clips", True, "beyond.cells.clock.own_clips: a clock hears of no clip"),
        (
            "beyond.cells.clips-1.incomplete",
            {"every": 30, "until": 0.5},
            "beyond.cells.clips-1.incomplete: no frame but the first would be left",
        ),
        (
            "beyond.cells.ours",
            VALUES["beyond"]["cells"]["choice"],
            "beyond.cells.ours: the name is taken by imitation.cells or adversarial.cells",
        ),
        (
            "simulate.sets",
            {"wide": {"task": "push", "contexts": "diverse", "demos": 4}},
            "split.wide: missing key",
        ),
        (
            "simulate.sets.rendered",
            {"task": "push", "contexts": "diverse", "demos": 4},
            "simulate.sets.rendered: the name is taken by the clips that stage render makes",
        ),
        (
            "simulate.sets.real",
            {"task": "push", "contexts": "diverse", "demos": 4},
            "simulate.sets.real: the name is taken by the clips that stage ingest makes",
        ),
        (
            "embeddings.sim",
            VALUES["embeddings"]["tcn"],
            "embeddings.sim: the name is taken by translators",
        ),
        (
            "adversarial.cells.ours",
            {"learner": "trpo", "reward": "gail"},
            "adversarial.cells.ours: the name is taken by imitation.cells",
        ),
        (
            "split.real",
            {"train": 0.9, "validation": 0.9},
            "split.real: the fractions train and validation sum to more than 1",
        ),
        (
            "simulate.sets.diverse.demos",
            "many",
            "simulate.sets.diverse.demos: Input should be a valid integer, got 'many'",
        ),
        ("simulate.shard", 10**20, "simulate.shard: no machine can do more than ten million"),
        (
            "simulate.sets.diverse.demos",
            True,
            "simulate.sets.diverse.demos: Input should be a valid integer, got True",
        ),
        ("sim.image_size", 65, "sim.image_size: Input should be 32, 64 or 128, got 65"),
        ("imitation.ddpg.discount", 1.0, "imitation.ddpg.discount: Input should be less than 1, got 1.0"),
        (
            "imitation.cells.ours.learner",
            "ppo",
            "imitation.cells.ours.learner: Input should be 'ddpg' or 'trpo'",
        ),
        ("translators.sim.iterations", 0, "translators.sim.iterations: Input should be greater"),
        (
            "real.film.width",
            100_000,
            "real.film.width: Input should be less than or equal to 1920, got 100000",
        ),
        ("sim", None, "sim: Input should be a valid dictionary"),
        (
            "split.diverse.validation",
            0.0,
            "split.diverse.validation: Input should be greater than 0, got 0.0",
        ),
        ("real.ingest.rate", math.inf, "real.ingest.rate: Input should be a finite number, got inf"),
        (
            "adversarial.cells.tpil.learner",
            "ppo",
            "adversarial.cells.tpil.learner: Input should be 'ddpg' or 'trpo', got 'ppo'",
        ),
        (
            "imitation.cells.ours.weights",
            {"feature": 0.0, "image": 0.0},
            "imitation.cells.ours.weights: at least one weight must be above 0",
        ),
        (
            "imitation.cells.ours.weights.feature",
            -1.0,
            "imitation.cells.ours.weights.feature: Input should be greater than or equal to 0, got -1.0",
        ),
        (
            "imitation.cells.ours.reward",
            "gail",
            "imitation.cells.ours.reward: Input should be 'translated', 'true', 'clock' or 'embedding'",
        ),
        (
            "evidence.losses.translators",
            ["sim", "tcn"],
            "evidence.losses.translators: 'tcn' is none of these: real-adam, ",
        ),
        ("evidence.losses.seeds", [1, 2, 1], "evidence.losses.seeds: one of them is listed twice"),
        (
            "evidence.losses.translators",
            ["sim", "real-pretrained"],
            "evidence: translators.real-pretrained.pretraining.iterations: no translator of the evidence ",
        ),
        (
            "evidence.losses.others.seeds",
            [7],
            "evidence.losses.others.seeds: some of them are not in evidence.losses.seeds",
        ),
        ("evidence.diversity.views", [4, 1], "evidence.diversity.views: they must rise"),
        ("evidence.diversity.views", ["any", 4], "evidence.diversity.views: they must rise"),
        (
            "evidence.headline.embedded",
            ["ours"],
            "evidence.headline.embedded: 'ours' is none of these: tcn",
        ),
        ("real.ingest.frames", 10**6, "real.ingest.frames: Input should be less than or equal to 10000"),
    ],
)
def test_an_impossible_value_is_named(path, value, said):
    with pytest.raises(AnyviewError) as caught:
        parse_params(changed(tuple(path.split(".")), value))
    assert str(caught.value).startswith(f"params.yaml: {said}")
    assert "\n" not in str(caught.value)


def test_a_name_that_is_no_folder_s_is_refused():
    values = copy.deepcopy(VALUES)
    values["translators"]["../sim"] = values["translators"]["sim"]
    with pytest.raises(AnyviewError, match=r"^params.yaml: translators.../sim: String should match pattern"):
        parse_params(values)


def test_a_missing_key_is_named():
    values = copy.deepcopy(VALUES)
    del values["imitation"]["cells"]["ours"]["model"]
    with pytest.raises(AnyviewError, match=r"^params.yaml: imitation.cells.ours.model: missing key$"):
        parse_params(values)


def test_of_a_misspelt_key_the_wrong_name_is_said_and_not_the_right_one():
    values = copy.deepcopy(VALUES)
    weights = values["imitation"]["cells"]["ours"]["weights"]
    weights["imgae"] = weights.pop("image")
    with pytest.raises(
        AnyviewError, match=r"imitation.cells.ours.weights.imgae: unknown key \(and 1 more\)$"
    ):
        parse_params(values)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("cell", ["human", "human-xirl", "clips-5"])
def test_what_a_method_beyond_depends_on_is_written_in_full(cell):
    """Checkpoints are kept by what is written."""
    params = parse_params(VALUES)
    written = params.imitating(cell).model_dump()["imitation"]
    assert written["cells"] == {cell: params.beyond.cells[cell].model_dump()}
    assert written["demonstrations"] == VALUES["beyond"]["cells"][cell]["demonstrations"]
    assert written["ddpg"]["discount"] == VALUES["imitation"]["ddpg"]["discount"]


def test_a_cell_beyond_may_look_farther_ahead_than_its_learner():
    values = changed(("beyond", "cells", "human", "discount"), 0.9)
    params = parse_params(values)
    assert params.imitating("human").imitation.ddpg.discount == 0.9
    assert params.imitation.ddpg.discount == VALUES["imitation"]["ddpg"]["discount"]


def test_what_goes_beyond_has_an_own_length_of_runs():
    values = changed(("beyond", "iterations"), 7)
    values["beyond"]["episodes_per_iteration"] = 3
    params = parse_params(values)
    for beyond in params.imitating("human"), params.going_beyond("ours"):
        assert (beyond.imitation.iterations, beyond.imitation.episodes_per_iteration) == (7, 3)
    assert params.imitation.iterations == VALUES["imitation"]["iterations"]


def test_further_mistakes_are_counted():
    values = changed(("base", "seed"), -1)
    values["imitation"]["runs"] = 0
    with pytest.raises(AnyviewError, match=r"\(and 1 more\)$"):
        parse_params(values)


@settings(max_examples=150)
@given(
    path=st.sampled_from(LEAVES),
    value=st.none()
    | st.text(max_size=4)
    | st.lists(st.integers(-2, 2), max_size=2)
    | st.dictionaries(st.text(max_size=3), st.integers(), max_size=2)
    | st.floats()
    | st.integers(-(10**20), 10**20),
)
def test_any_value_is_taken_or_refused_in_one_line(path, value):
    said = refusal(lambda: parse_params(changed(path, value)))
    block = ".".join(path[:-1])  # is refused itself where its keys do not fit each other
    assert said is None or ".".join(path) in said or said.startswith(f"params.yaml: {block}: ")


ALIASES = "a: &a [x, x]\n" + "".join(f"{new}: &{new} [*{old}, *{old}]\n" for old, new in pairwise(LETTERS))


@pytest.mark.parametrize(
    "content",
    [
        *(b"a: [1", b"a: b: c", b"\xff\xfe", b"- 1\n- 2", b"", b"\t", b"a: &x *x", b"1"),
        *(b"a: !!python/object/apply:os.abort []", b"a: !!float x", b"a: 2001-99-99", b"a: " + b"9" * 5000),
        *(b"a: " + b"[" * 400, b"base: {seed: 2, " + b"x" * 100_000 + b": 1}"),
        f"{ALIASES}base: {{seed: *z}}".encode(),  # two to the power of 26, were it written out
    ],
    ids=lambda content: content[:30],
)
def test_a_file_that_is_no_params_is_named(tmp_path, content):
    path = tmp_path / "params.yaml"
    path.write_bytes(content)
    with pytest.raises(AnyviewError, match=r"params\.yaml: ") as caught:
        load_params(path)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(AnyviewError, match="no such file; run from the root of the repository"):
        load_params(tmp_path / "params.yaml")


def test_mutated_files_are_taken_or_refused_in_one_line(tmp_path):
    content = PARAMS.read_bytes()
    rng = random.Random(0)
    path = tmp_path / "params.yaml"
    for _ in range(25):
        mutant = bytearray(content)
        for _ in range(rng.randint(1, 3)):
            place = rng.randrange(len(mutant))
            mutant[place : place + rng.randrange(3)] = rng.randbytes(rng.randrange(3))
        path.write_bytes(mutant)
        refusal(lambda: load_params(path))


def test_numbers_are_read_as_dvc_reads_them(tmp_path):
    path = tmp_path / "numbers.yaml"
    path.write_text("rate: 1e-3\nflag: no\n")
    assert read_yaml(path) == {"rate": 0.001, "flag": "no"}
