"""DDPG: it learns, rows are independent, it resumes bit for bit, and its targets are the textbook's."""

import numpy as np
import pytest
import torch

from anyview import config
from anyview.learners.common.policies import Policy, with_time_bumps
from anyview.learners.ddpg import DDPG
from anyview.pusher.contexts import Context
from tests.learners.tracking import ACTION, HORIZON, OBSERVATION, Tracking, mean_distance, practise

PARAMS = config.DDPG(
    hidden=[32, 32],
    policy_learning_rate=0.001,
    critic_learning_rate=0.002,
    discount=0.5,
    batch_size=32,
    updates_per_step=1.0,
    preactivation_penalty=0.1,
    target_rate=0.1,
    replay=20000,
    recent_episodes=5,
    warmup_episodes=3,
    n_step=1,
    time_bumps=13,
    noise=0.3,
    noise_end=0.05,
    noise_theta=0.6,
)


def make(runs: list[int], copies: int = 1, iterations: int = 60, **changes: object) -> DDPG:
    torch.set_num_threads(1)
    params = PARAMS.model_copy(update=changes)
    return DDPG(params, 7, runs, OBSERVATION, ACTION, HORIZON, copies, iterations, device=torch.device("cpu"))


def test_learns_to_follow_a_path() -> None:
    runs = [0, 1, 2, 3]
    learner, world = make(runs, updates_per_step=2.0), Tracking(runs)
    standing = np.linalg.norm(world.path[:, 1:], axis=-1).mean(1)
    practise(learner, world, 60)
    assert np.median(mean_distance(learner, Tracking(runs)) / standing) < 0.2


def test_a_row_is_the_same_alone_and_in_company() -> None:
    """Lockstep is an implementation detail: over its first updates a run does not know of the others."""
    together, alone = make([3, 4, 5], copies=2), make([4], copies=2)
    practise(together, Tracking([3, 4, 5], 2), 3)
    practise(alone, Tracking([4], 2), 3)
    for name, weights in alone.policy().items():
        np.testing.assert_allclose(together.policy()[name][1], weights[0], atol=2e-5, rtol=2e-3)
    assert not np.allclose(together.policy()["weight0"][0], alone.policy()["weight0"][0], atol=1e-3)


def test_resumes_bit_for_bit() -> None:
    runs = [0, 1]
    whole, world = make(runs, copies=2, replay=300), Tracking(runs, 2)
    practise(whole, world, 5)
    state = {name: array.copy() for name, array in whole.state().items()}
    practise(whole, world, 3)
    resumed = make(runs, copies=2, replay=300)
    resumed.restore(state)
    practise(resumed, world, 3)
    for name, weights in whole.policy().items():
        np.testing.assert_array_equal(resumed.policy()[name], weights)


@pytest.mark.parametrize("n", [1, 3, 49])
def test_transitions_hold_n_step_returns(n: int) -> None:
    """Against the definition, step by step, with no bootstrapping past the end."""
    learner = make([0, 1], copies=2, n_step=n, warmup_episodes=10**6)
    world, rewards, seen = Tracking([0, 1], 2), [], []
    observations = world.reset()
    for step in range(1, HORIZON + 1):
        actions = learner.act(observations, explore=True)
        following, reward = world.step(actions)
        learner.record(observations, actions, reward, following, step)
        rewards.append(reward)
        seen.append(observations)
        observations = following
    seen.append(observations)
    rows = learner._transitions().unflatten(1, (2, HORIZON)).numpy()
    for t in (0, 20, 45, 48):
        expected = sum(0.5**k * rewards[t + k] for k in range(min(n, HORIZON - t)))
        np.testing.assert_allclose(rows[:, :, t, 7], expected, rtol=1e-5)
        np.testing.assert_array_equal(rows[:, :, t, :5], seen[t])
        if t + n < HORIZON:
            np.testing.assert_array_equal(rows[:, :, t, 8:13], seen[t + n])
            np.testing.assert_allclose(rows[:, :, t, 13], 0.5**n, rtol=1e-6)
        else:
            assert (rows[:, :, t, 13] == 0).all()


def test_an_update_is_the_textbooks() -> None:
    """One update of one row against torch's own layers, autograd and Adam."""
    learner = make([0], warmup_episodes=10**6)
    practise(learner, Tracking([0]), 2)
    policy, critic = _layers(learner._policy), _layers(learner._critic)
    target_policy, target_critic = _layers(learner._target_policy), _layers(learner._target_critic)
    batch = learner._replay.take(torch.arange(40)[None])
    observations, actions, returns, following, beyond = batch[0].split([5, 2, 1, 5, 1], dim=-1)
    inputs, next_inputs = with_time_bumps(observations, 13), with_time_bumps(following, 13)
    with torch.no_grad():
        next_values = target_critic(torch.cat([next_inputs, torch.tanh(target_policy(next_inputs))], -1))
    optimiser = torch.optim.Adam(critic.parameters(), lr=0.002)
    loss = torch.nn.functional.mse_loss(
        critic(torch.cat([inputs, actions], -1)), returns + beyond * next_values
    )
    loss.backward()
    optimiser.step()
    ascent = torch.optim.Adam(policy.parameters(), lr=0.001)
    before_tanh = policy(inputs)
    value = critic(torch.cat([inputs, torch.tanh(before_tanh)], -1)).mean()
    (0.1 * before_tanh.square().sum(-1).mean() - value).backward()
    ascent.step()
    before = learner._target_critic.flat.clone()
    learner._update(batch)
    for network, expected in ((learner._policy, policy), (learner._critic, critic)):
        ours = torch.cat([part[0].flatten() for layer in network.layers for part in layer]).detach()
        theirs = torch.cat([part.detach().t().flatten() for part in expected.parameters()])
        torch.testing.assert_close(ours, theirs, atol=1e-5, rtol=1e-3)
    torch.testing.assert_close(
        learner._target_critic.flat, 0.9 * before + 0.1 * learner._critic.flat, atol=1e-6, rtol=1e-5
    )


def _layers(network) -> torch.nn.Sequential:
    parts: list[torch.nn.Module] = []
    for weight, bias in network.layers:
        linear = torch.nn.Linear(weight.shape[1], weight.shape[2])
        linear.weight.data, linear.bias.data = weight[0].detach().T.clone(), bias[0, 0].detach().clone()
        parts += [linear, torch.nn.ReLU()]
    return torch.nn.Sequential(*parts[:-1])


def test_exploration_shrinks_and_acting_without_it_is_repeatable() -> None:
    learner, observations = make([0, 1], iterations=4), Tracking([0, 1]).reset()
    greedy = learner.act(observations, explore=False)
    np.testing.assert_array_equal(greedy, learner.act(observations, explore=False))
    spread = []
    for iteration in range(4):
        learner._iteration = iteration
        learner._begin()
        spread.append(learner._noise.std())
    assert spread[0] > 1.2 * spread[1] > 1.2**2 * spread[2] > 1.2**3 * spread[3]


def test_a_stored_policy_acts_like_its_learner() -> None:
    learner = make([0, 1])
    practise(learner, Tracking([0, 1]), 4)
    observations = Tracking([0, 1]).reset()
    expected = learner.act(observations, explore=False)
    context = Context(0.0, (0.0, 0.0), (0.0, 0.0), (0.0, 0.0, 0.0), ())
    for run in range(2):
        weights = {name: array[run] for name, array in learner.policy().items()}
        stored = Policy("ddpg", "twist", 64, context, weights)
        np.testing.assert_allclose(stored.act(observations[run, 0]), expected[run, 0], atol=1e-6)
