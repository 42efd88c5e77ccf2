"""DDPG: it learns, rows are independent, it resumes bit for bit, and its targets are the textbook's."""

import numpy as np
import pytest
import torch

from anyview import config
from anyview.learners.common.policies import Policy
from anyview.learners.common.stacked import StackedMLP
from anyview.learners.ddpg import (
    DDPG,
    Transitions,
    critic_loss,
    critic_targets,
    minibatch_ages,
    n_step_transitions,
    policy_loss,
)
from anyview.pusher.contexts import Context
from tests.learners.tracking import (
    ACTION,
    HORIZON,
    OBSERVATION,
    Tracking,
    mean_distance,
    practise,
    practise_rescored,
)

PARAMS = config.DDPG(
    hidden=[32, 32],
    policy_learning_rate=0.001,
    critic_learning_rate=0.002,
    discount=0.5,
    batch_size=32,
    updates_per_step=1.0,
    preactivation_penalty=0.1,
    target_rate=0.1,
    average=0,
    replay=20000,
    recent_episodes=5,
    warmup_episodes=3,
    n_step=1,
    time_features=13,
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


@pytest.mark.parametrize("average", [0, 50])
def test_resumes_bit_for_bit(average: int) -> None:
    runs = [0, 1]
    whole, world = make(runs, copies=2, replay=300, average=average), Tracking(runs, 2)
    practise(whole, world, 5)
    state = {name: array.copy() for name, array in whole.state().items()}
    practise(whole, world, 3)
    resumed = make(runs, copies=2, replay=300, average=average)
    resumed.restore(state)
    practise(resumed, world, 3)
    for name, weights in whole.policy().items():
        np.testing.assert_array_equal(resumed.policy()[name], weights)


@pytest.mark.parametrize("n", [1, 3])
def test_rescored_rewards_replace_those_recorded_and_older_episodes_are_not_used(n: int) -> None:
    runs, memory = [0, 1], 6
    heard = make(runs, copies=2, n_step=n, replay=memory * HORIZON)
    practise(heard, Tracking(runs, 2), 5)
    told = make(runs, copies=2, n_step=n)
    practise_rescored(told, Tracking(runs, 2), 5, memory)
    for name, weights in heard.policy().items():
        np.testing.assert_array_equal(told.policy()[name], weights)


@pytest.mark.parametrize("n", [1, 3, 49])
def test_transitions_hold_n_step_returns(n: int) -> None:
    """Against the definition, step by step, with no bootstrapping past the end."""
    generator = torch.Generator().manual_seed(n)
    seen = torch.randn(HORIZON + 1, 2, 3, OBSERVATION, generator=generator)
    actions = torch.randn(HORIZON, 2, 3, ACTION, generator=generator)
    rewards = torch.randn(HORIZON, 2, 3, generator=generator)
    found = n_step_transitions(seen[:-1], actions, rewards, seen[1:], 0.5, n)
    assert torch.equal(found.observations, seen[:-1])
    assert torch.equal(found.actions, actions)
    for t in (0, 20, 45, 48):
        expected = sum(0.5**k * rewards[t + k] for k in range(min(n, HORIZON - t)))
        torch.testing.assert_close(found.returns[t, ..., 0], expected)
        if t + n < HORIZON:
            assert torch.equal(found.next_observations[t], seen[t + n])
            torch.testing.assert_close(found.bootstrap_discounts[t], torch.full((2, 3, 1), 0.5**n))
        else:
            assert (found.bootstrap_discounts[t] == 0).all()


def test_half_of_each_batch_comes_from_the_newest_transitions() -> None:
    ages = minibatch_ages(np.random.default_rng(0), updates=500, batch_size=9, newest=10, size=1000)
    assert ages.shape == (500, 9)
    assert set(ages[:, :4].flat) == set(range(10))
    assert 450 < ages[:, 4:].mean() < 550
    assert ages.max() < 1000


def networks(*sizes: int, seed: int) -> tuple[StackedMLP, list[torch.nn.Sequential]]:
    """Two random networks stacked, and each of them of torch's own layers."""
    stacked = StackedMLP.initial(sizes, np.random.default_rng(seed).spawn(2), torch.device("cpu"))
    stacked.flat.add_(
        torch.randn(stacked.flat.shape, generator=torch.Generator().manual_seed(seed)), alpha=0.1
    )
    alone = []
    for row in range(2):
        parts: list[torch.nn.Module] = []
        for weight, bias in stacked.layers:
            linear = torch.nn.Linear(weight.shape[1], weight.shape[2])
            linear.weight.data, linear.bias.data = weight[row].T.clone(), bias[row, 0].clone()
            parts += [linear, torch.nn.ReLU()]
        alone.append(torch.nn.Sequential(*parts[:-1]))
    return stacked, alone


def gradients(network: StackedMLP, loss: torch.Tensor) -> list[torch.Tensor]:
    """Of the weights and biases of both networks, row by row as torch's layers have them."""
    found = torch.autograd.grad(loss, [part for layer in network.layers for part in layer])
    return [each[row].T if each.shape[1] > 1 else each[row, 0] for row in range(2) for each in found]


def test_targets_and_losses_are_the_textbooks() -> None:
    """Of two stacked networks against torch's own layers and autograd, one by one."""
    policy, policies = networks(OBSERVATION, 16, ACTION, seed=1)
    critic, critics = networks(OBSERVATION + ACTION, 16, 1, seed=2)
    generator = torch.Generator().manual_seed(3)
    inputs, next_inputs = torch.randn(2, 2, 40, OBSERVATION, generator=generator)
    actions = torch.rand(2, 40, ACTION, generator=generator) * 2 - 1
    returns, discounts = torch.rand(2, 2, 40, 1, generator=generator)
    batch = Transitions(inputs, actions, returns, next_inputs, discounts)
    targets = critic_targets(policy, critic, batch, next_inputs)
    for network in (policy, critic):
        for layer in network.layers:
            for part in layer:
                part.requires_grad_()
    of_critic = critic_loss(critic, inputs, actions, targets)
    of_policy = policy_loss(policy, critic, inputs, 0.1)
    assert targets.shape == (2, 40, 1)
    assert of_critic.shape == of_policy.shape == (2, 1)
    critic_gradients, policy_gradients = [], []
    for row in range(2):
        with torch.no_grad():
            chosen = torch.tanh(policies[row](next_inputs[row]))
            values = critics[row](torch.cat([next_inputs[row], chosen], -1))
        torch.testing.assert_close(targets[row], returns[row] + discounts[row] * values)
        estimates = critics[row](torch.cat([inputs[row], actions[row]], -1))
        loss = torch.nn.functional.mse_loss(estimates, targets[row])
        torch.testing.assert_close(of_critic[row, 0], loss)
        critic_gradients += torch.autograd.grad(loss, list(critics[row].parameters()))
        before_tanh = policies[row](inputs[row])
        value = critics[row](torch.cat([inputs[row], torch.tanh(before_tanh)], -1)).mean()
        loss = 0.1 * before_tanh.square().sum(-1).mean() - value
        torch.testing.assert_close(of_policy[row, 0], loss)
        policy_gradients += torch.autograd.grad(loss, list(policies[row].parameters()))
    for network, loss, expected in (
        (critic, of_critic, critic_gradients),
        (policy, of_policy, policy_gradients),
    ):
        for found, wanted in zip(gradients(network, loss.sum()), expected, strict=True):
            torch.testing.assert_close(found, wanted, atol=1e-5, rtol=1e-3)


def test_target_networks_follow_by_the_target_rate() -> None:
    """One update after one episode."""
    learner = make([0, 1], warmup_episodes=1, updates_per_step=1 / HORIZON)
    before = {name: array.copy() for name, array in learner.state().items()}
    practise(learner, Tracking([0, 1]), 1)
    after = learner.state()
    for name in ("policy", "critic"):
        assert (after[name] != before[name]).any()
        expected = 0.9 * before[f"target_{name}"] + 0.1 * after[name]
        np.testing.assert_allclose(after[f"target_{name}"], expected, atol=1e-6, rtol=1e-5)


def test_without_noise_a_mean_of_the_latest_weights_acts(monkeypatch) -> None:
    """It is the mean of all at first. What is explored and learned does not know of it."""
    learner, plain, world = make([0, 1], average=7), make([0, 1]), Tracking([0, 1])
    weights: list[torch.Tensor] = []
    update = learner._update

    def watched(batch: Transitions) -> None:
        update(batch)
        weights.append(learner._policy.flat.clone())

    monkeypatch.setattr(learner, "_update", watched)
    practise(learner, world, 5)
    practise(plain, Tracking([0, 1]), 5)
    mean = weights[0]
    for count, each in enumerate(weights[1:], 2):
        mean = mean + (each - mean) / min(7, count)
    state = learner.state()
    np.testing.assert_allclose(state["averaged"], mean, atol=1e-5, rtol=1e-4)
    for name, array in plain.state().items():
        np.testing.assert_array_equal(state[name], array)
    observations = world.reset()
    with_noise, without = (learner.act(observations, explore=each) for each in (True, False))
    np.testing.assert_array_equal(with_noise, plain.act(observations, explore=True))
    assert not np.allclose(without, plain.act(observations, explore=False), atol=1e-4)


def test_exploration_shrinks_and_acting_without_it_is_repeatable() -> None:
    learner, world = make([0, 1], iterations=4, warmup_episodes=10**6), Tracking([0, 1])
    greedy = learner.act(world.reset(), explore=False)
    np.testing.assert_array_equal(greedy, learner.act(world.reset(), explore=False))
    spread = []
    for _ in range(4):
        observations, away = world.reset(), []
        for step in range(1, HORIZON + 1):
            actions = learner.act(observations, explore=True)
            away.append(actions - learner.act(observations, explore=False))
            next_observations, rewards = world.step(actions)
            learner.record(observations, actions, rewards, next_observations, step)
            observations = next_observations
        learner.end_iteration()
        spread.append(np.std(away))
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
