"""The Gymnasium environments, by Gymnasium's own rules."""

import subprocess
import sys
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from anyview.pusher.contexts import sample_contexts

ENV_ID = "anyview/Pusher3DoF-v0"


@pytest.mark.parametrize("control", ["twist", "torque"])
def test_check_env_passes_without_a_warning(control: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym.make(ENV_ID, control=control, render_mode="rgb_array").unwrapped)


def test_importing_the_package_is_enough() -> None:
    code = f"import gymnasium, anyview; print(gymnasium.make({ENV_ID!r}).unwrapped)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "PusherEnv" in done.stdout


@pytest.mark.parametrize(("name", "value"), [("control", "tourque"), ("kind", "wide")])
def test_a_misspelt_choice_is_refused(name: str, value: str) -> None:
    for make in (gym.make, gym.make_vec):
        with pytest.raises(ValueError, match=f"{name} '{value}': must be "):
            make(ENV_ID, **{name: value})


def test_vector_environment_equals_single_ones_step_for_step() -> None:
    count = 3
    together = gym.make_vec(ENV_ID, num_envs=count, vectorization_mode="vector_entry_point")
    alone = [gym.make(ENV_ID) for _ in range(count)]
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


def test_contexts_can_be_fixed_and_frames_seen() -> None:
    contexts, _ = sample_contexts(np.random.default_rng(1), 2)
    vector = gym.make_vec(
        ENV_ID,
        num_envs=2,
        vectorization_mode="vector_entry_point",
        contexts=contexts,
        render_mode="rgb_array",
    )
    vector.reset(seed=0)
    single = gym.make(ENV_ID, context=contexts[1], render_mode="rgb_array")
    single.reset(seed=5)
    np.testing.assert_array_equal(vector.render()[1], single.render())
    observation, _ = single.reset(options={"context": contexts[0]})
    np.testing.assert_array_equal(observation, vector.reset()[0][0])
