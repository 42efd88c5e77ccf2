"""The Gymnasium environments, by Gymnasium's own rules."""

import copy
import pickle
import subprocess
import sys
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from anyview.pusher.contexts import sample_contexts

ENV_ID = "anyview/Pusher3DoF-v0"
ENV_IDS = [f"anyview/{name}3DoF-v0" for name in ("Pusher", "Reacher", "Striker", "Sweeper")]
NAN, INF = float("nan"), float("inf")


def single(env_id: str = ENV_ID, **options: Any) -> gym.Env:
    return gym.make(env_id, **options)


def vector(count: int = 2, env_id: str = ENV_ID, **options: Any) -> gym.vector.VectorEnv:
    return gym.make_vec(env_id, num_envs=count, vectorization_mode="vector_entry_point", **options)


@pytest.mark.parametrize("control", ["twist", "torque"])
@pytest.mark.parametrize("env_id", ENV_IDS)
def test_check_env_passes_without_a_warning(env_id: str, control: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym.make(env_id, control=control, render_mode="rgb_array").unwrapped)


def test_importing_the_package_is_enough() -> None:
    code = f"import gymnasium, anyview; print(gymnasium.make({ENV_ID!r}).unwrapped)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "PusherEnv" in done.stdout


@pytest.mark.parametrize(("name", "value"), [("control", "tourque"), ("kind", "wide")])
def test_a_misspelt_choice_is_refused(name: str, value: str) -> None:
    for make in (gym.make, gym.make_vec):
        with pytest.raises(ValueError, match=f"{name} '{value}': must be "):
            make(ENV_ID, **{name: value})


@pytest.mark.parametrize("env_id", ENV_IDS)
def test_vector_environment_equals_single_ones_step_for_step(env_id: str) -> None:
    count = 3
    together = vector(count, env_id)
    alone = [single(env_id) for _ in range(count)]
    observations, _ = together.reset(seed=7)
    singles = [env.reset(seed=7 + i)[0] for i, env in enumerate(alone)]
    np.testing.assert_array_equal(observations, singles)
    rng = np.random.default_rng(0)
    for step in range(1, 61):  # past the end of an episode
        actions = rng.uniform(-1, 1, (count, 3)).astype(np.float32)
        observations, rewards, terminated, truncated, info = together.step(actions)
        if step == 50:  # the vector environment resets on the step after the last
            expected = [(env.reset()[0], 0.0, False, False) for env in alone]
        else:
            expected = [env.step(action)[:4] for env, action in zip(alone, actions, strict=True)]
        for got, column in zip(
            (observations, rewards, terminated, truncated), zip(*expected, strict=True), strict=True
        ):
            np.testing.assert_array_equal(got, np.array(column))
        assert truncated.all() == (step == 49)
        assert info["is_success"].shape == (count,)


def test_vector_environment_keeps_gymnasiums_rules() -> None:
    env = RecordEpisodeStatistics(vector(3))
    assert env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    first, _ = env.reset(seed=3)
    again, info = env.reset(seed=3)
    assert data_equivalence(first, again, exact=True)
    assert not (env.reset(seed=4)[0] == first).all(axis=1).any()
    env.reset(seed=[3, 4, 5])
    total = np.zeros(3)
    kept: list[tuple[np.ndarray, np.ndarray]] = []
    for _ in range(49):
        observations, rewards, terminated, truncated, info = env.step(env.action_space.sample())
        assert env.observation_space.contains(observations)
        assert (rewards.dtype, rewards.shape) == (np.float64, (3,))
        assert (terminated.dtype, truncated.dtype) == (bool, bool)
        kept.append((observations, observations.copy()))
        total += rewards
    assert truncated.all()
    np.testing.assert_array_equal(info["episode"]["l"], 49)
    np.testing.assert_allclose(info["episode"]["r"], total)
    for observations, at_the_time in kept:  # a step never writes into what an earlier one returned
        np.testing.assert_array_equal(observations, at_the_time)


def test_contexts_can_be_fixed_and_frames_seen() -> None:
    contexts, _ = sample_contexts(np.random.default_rng(1), 2)
    together = vector(contexts=contexts, render_mode="rgb_array")
    together.reset(seed=0)
    alone = single(context=contexts[1], render_mode="rgb_array")
    alone.reset(seed=5)
    np.testing.assert_array_equal(together.render()[1], alone.render())
    observation, _ = alone.reset(options={"context": contexts[0]})
    np.testing.assert_array_equal(observation, together.reset()[0][0])


@pytest.mark.parametrize("make", [single, vector])
@pytest.mark.parametrize(
    ("spoil", "complaint"),
    [
        (lambda action: action * NAN, "expected finite numbers, got "),
        (lambda action: action + INF, "expected finite numbers, got "),
        (lambda action: action[..., :2], r"expected the shape \((2, )?3,?\), got \((2, )?2,?\)"),
        (lambda action: action[None], r"expected the shape \((2, )?3,?\), got \(1, (2, )?3\)"),
        (lambda action: "left", "expected numbers of shape .*, got 'left'"),
    ],
)
def test_an_impossible_action_is_refused_and_changes_nothing(
    make: Callable[[], Any], spoil: Callable[[np.ndarray], Any], complaint: str, tmp_path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    spoilt, other = make().unwrapped, make().unwrapped
    action = np.full(other.action_space.shape, 0.5, np.float32)
    for env in (spoilt, other):
        env.reset(seed=1)
    with pytest.raises(ValueError, match=f"^action: {complaint}"):
        spoilt.step(spoil(action))
    np.testing.assert_array_equal(spoilt.step(action)[0], other.step(action)[0])
    assert list(tmp_path.iterdir()) == []  # MuJoCo keeps a log in the working directory once it warns


def test_an_impossible_reset_is_refused() -> None:
    context = sample_contexts(np.random.default_rng(1), 1)[0][0]
    striking = sample_contexts(np.random.default_rng(1), 1, task="strike")[0][0]
    for options, complaint in (
        ({"context": {"azimuth": 0.0}}, "context: expected a Context .*, got {'azimuth': 0.0}"),
        ({"contexts": [context]}, "options: 'contexts': expected 'context'"),
        ({"context": striking}, "context: it is one of task strike, but the environment is for push"),
    ):
        with pytest.raises(ValueError, match=complaint):
            single().reset(options=options)
    with pytest.raises(ValueError, match="options: 'context': expected none"):
        vector().reset(options={"context": context})
    with pytest.raises(ValueError, match="3 seeds for 2 environments"):
        vector().reset(seed=[1, 2, 3])
    with pytest.raises(ValueError, match="context: expected a Context"):
        vector(1, contexts=[None])


@pytest.mark.parametrize("make", [single, vector])
def test_a_reset_comes_first(make: Callable[..., Any]) -> None:
    env = make(render_mode="rgb_array").unwrapped
    for call in (lambda: env.step(env.action_space.sample()), env.render):
        with pytest.raises(gym.error.ResetNeeded, match=r"call reset\(\) first"):
            call()


def test_every_environment_has_spaces_of_its_own() -> None:
    one, other, together = single(), single(), vector()
    one.action_space.seed(5)
    expected = one.action_space.sample()
    one.action_space.seed(5)
    for space in (other.action_space, together.action_space, together.single_action_space):
        space.seed(6)
    np.testing.assert_array_equal(one.action_space.sample(), expected)
    assert one.observation_space is not other.observation_space


def unfold(env: Any, steps: int) -> list[Any]:
    """What ``env`` returns for ``steps`` actions that its own space samples."""
    return [env.step(env.action_space.sample()) for _ in range(steps)]


@pytest.mark.parametrize("make", [single, vector, partial(single, ENV_IDS[2])])
@pytest.mark.parametrize("control", ["twist", "torque"])
@pytest.mark.parametrize("again", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
@pytest.mark.parametrize("steps", [None, 0, 20])
def test_a_copy_continues_exactly(
    make: Callable[..., Any], control: str, again: Callable[[Any], Any], steps: int | None
) -> None:
    env = make(control=control, render_mode="rgb_array")
    env.action_space.seed(2)
    if steps is not None:
        env.reset(seed=8)
        unfold(env, steps)
    twin = again(env)
    if steps is None:
        assert data_equivalence(env.reset(seed=8), twin.reset(seed=8), exact=True)
    rest = 49 - (steps or 0)
    assert data_equivalence(unfold(env, rest), unfold(twin, rest), exact=True)
    assert data_equivalence(env.render(), twin.render(), exact=True)
    assert data_equivalence(env.reset(), twin.reset(), exact=True)  # the next context, too


def test_frames_can_be_seen_from_any_thread() -> None:
    envs = [single(render_mode="rgb_array") for _ in range(3)]
    for seed, env in enumerate(envs):
        env.reset(seed=seed)
    expected = [env.render() for env in envs]
    with ThreadPoolExecutor(3) as pool:
        for _ in range(5):
            np.testing.assert_array_equal(list(pool.map(lambda env: env.render(), envs)), expected)
