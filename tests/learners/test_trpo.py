"""TRPO against independent calculations, its trust region, and its rows' independence."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from safetensors.numpy import load, save
from torch.distributions import Normal, kl_divergence

from anyview import config
from anyview.learners.trpo import (
    TRPO,
    GaussianPolicy,
    advantage_estimates,
    baseline_features,
    conjugate_gradient,
    discounted_sums,
    fisher_product,
    fitted_values,
    policy_step,
)

HORIZON = 6
PARAMS = config.TRPO(
    hidden=[8],
    initial_std=0.4,
    batch_episodes=8,
    discount=0.9,
    gae_lambda=1.0,
    step=0.05,
    damping=0.1,
    conjugate_gradient_steps=10,
)


def random_policy(rows: int, hidden: tuple[int, ...] = (4, 3)) -> tuple[GaussianPolicy, torch.Tensor]:
    policy = GaussianPolicy(3, hidden, 2)
    rng = np.random.default_rng(5)
    theta = np.stack([policy.initial(rng, 0.7) for _ in range(rows)])
    return policy, torch.from_numpy(theta + 0.3 * rng.standard_normal(theta.shape))


def test_fisher_product_is_that_of_the_explicit_fisher_matrix():
    policy, theta = random_policy(rows=2)
    rng = np.random.default_rng(0)
    observations = torch.from_numpy(rng.standard_normal((2, 7, 3)))
    vector = torch.from_numpy(rng.standard_normal(theta.shape))
    result = fisher_product(policy, theta, observations, damping=0.25)(vector)

    size, actions, step = theta.shape[1], 2, 1e-6
    for row in range(2):
        # F = E[J' diag(1 / std^2) J] for the mean's Jacobian J, and 2 for each log std.
        jacobian = np.zeros((7, actions, size))
        for p in range(size):
            shift = torch.zeros_like(theta)
            shift[row, p] = step
            upper, _ = policy.distribution(theta + shift, observations)
            lower, _ = policy.distribution(theta - shift, observations)
            jacobian[:, :, p] = (upper - lower)[row].numpy() / (2 * step)
        precision = np.exp(-2 * theta[row, -actions:].numpy())
        fisher = np.einsum("bap,a,baq->pq", jacobian, precision, jacobian) / 7
        fisher[-actions:, -actions:] += 2 * np.eye(actions)
        expected = fisher @ vector[row].numpy() + 0.25 * vector[row].numpy()
        np.testing.assert_allclose(result[row].numpy(), expected, rtol=1e-5, atol=1e-7)


def test_log_probability_and_divergence_match_torch_distributions():
    policy, old = random_policy(rows=3)
    rng = np.random.default_rng(1)
    new = old + 0.1 * torch.from_numpy(rng.standard_normal(old.shape))
    observations = torch.from_numpy(rng.standard_normal((3, 5, 3)))
    actions = torch.from_numpy(rng.standard_normal((3, 5, 2)))
    before, after = (
        Normal(mean, log_std.exp().expand_as(mean))
        for mean, log_std in (policy.distribution(theta, observations) for theta in (old, new))
    )
    constant = -np.log(2 * np.pi)  # of two action dimensions
    expected = after.log_prob(actions).sum(-1)
    torch.testing.assert_close(policy.log_probability(new, observations, actions) + constant, expected)
    expected = kl_divergence(before, after).sum(-1).mean(-1)
    torch.testing.assert_close(policy.divergence(old, new, observations), expected)


def test_conjugate_gradient_solves_each_row_and_leaves_a_zero_row_at_zero():
    rng = np.random.default_rng(2)
    roots = rng.standard_normal((3, 6, 6))
    matrices = roots @ roots.transpose(0, 2, 1) + np.eye(6)
    targets = rng.standard_normal((3, 6))
    targets[2] = 0
    stack = torch.from_numpy(matrices)
    solution = conjugate_gradient(
        lambda v: torch.einsum("rij,rj->ri", stack, v), torch.from_numpy(targets), steps=12
    )
    expected = np.linalg.solve(matrices, targets[..., None])[..., 0]
    np.testing.assert_allclose(solution.numpy(), expected, atol=1e-8)


@given(st.integers(0, 2**32 - 1), st.floats(0, 0.99), st.floats(0, 1))
@settings(max_examples=25)
def test_advantages_match_their_definition(seed: int, discount: float, gae_lambda: float):
    rng = np.random.default_rng(seed)
    rewards, values = rng.standard_normal((2, 2, 3, HORIZON))
    result = advantage_estimates(torch.from_numpy(rewards), torch.from_numpy(values), discount, gae_lambda)
    next_values = np.concatenate([values[..., 1:], np.zeros((2, 3, 1))], axis=-1)
    delta = rewards + discount * next_values - values
    for t in range(HORIZON):
        expected = sum((discount * gae_lambda) ** k * delta[..., t + k] for k in range(HORIZON - t))
        np.testing.assert_allclose(result[..., t].numpy(), expected, atol=1e-10)


def test_with_lambda_one_the_advantage_is_the_return_less_the_value():
    rng = np.random.default_rng(3)
    rewards, values = torch.from_numpy(rng.standard_normal((2, 1, 4, HORIZON)))
    advantages = advantage_estimates(rewards, values, discount=0.9, gae_lambda=1.0)
    torch.testing.assert_close(advantages, discounted_sums(rewards, 0.9) - values)


def test_baseline_predicts_a_quadratic_value_and_keeps_rows_apart():
    rng = np.random.default_rng(4)
    observations = torch.from_numpy(rng.uniform(-1, 1, (2, 40, HORIZON, 3)))
    time = torch.linspace(0, 1, HORIZON, dtype=torch.float64)
    returns = 2 * observations[..., 0] - observations[..., 1] ** 2 + 3 * time**2 + 5
    returns[1] = 0.0
    values = fitted_values(baseline_features(observations), returns)
    assert (values[0] - returns[0]).std() < 0.02 * returns[0].std()
    assert values[1].abs().max() < 1e-9


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.001, 0.01, 0.1]))
@settings(max_examples=20)
def test_policy_step_improves_the_surrogate_within_the_divergence_bound(seed: int, bound: float):
    policy, theta = random_policy(rows=3)
    rng = np.random.default_rng(seed)
    observations = torch.from_numpy(rng.standard_normal((3, 30, 3)))
    actions = torch.from_numpy(rng.standard_normal((3, 30, 2)))
    advantages = torch.from_numpy(rng.standard_normal((3, 30)))
    advantages[1] = 0.0  # nothing to gain: this row must stay
    params = PARAMS.model_copy(update={"step": bound})
    new = policy_step(policy, theta, observations, actions, advantages, params)

    assert (policy.divergence(theta, new, observations) <= bound).all()
    ratio = policy.log_probability(new, observations, actions) - policy.log_probability(
        theta, observations, actions
    )
    gain = (ratio.exp() * advantages).mean(-1) - advantages.mean(-1)
    moved = (new != theta).any(-1)
    assert not moved[1]
    assert (gain[moved] > 0).all()
    assert moved[[0, 2]].any()


def test_a_first_step_uses_much_of_the_trust_region():
    policy, theta = random_policy(rows=2)
    rng = np.random.default_rng(8)
    observations = torch.from_numpy(rng.standard_normal((2, 200, 3)))
    mean, log_std = policy.distribution(theta, observations)
    actions = mean + log_std.exp() * torch.from_numpy(rng.standard_normal((2, 200, 2)))
    advantages = actions[..., 0] - actions[..., 0].mean(-1, keepdim=True)
    new = policy_step(policy, theta, observations, actions, advantages, PARAMS)
    assert (policy.divergence(theta, new, observations) > 0.2 * PARAMS.step).all()


class Tracking:
    """Rows are rewarded for actions close to a target of their own, scaled by what they observe."""

    def __init__(self, runs: list[int], copies: int = 4):
        self._targets = np.array([(-0.6, 0.5, 0.1)[run] for run in runs])[:, None, None]
        self._rngs = [np.random.default_rng(run) for run in runs]
        self._copies = copies

    def observe(self, step: int) -> np.ndarray:
        own = np.stack([rng.uniform(0.5, 1, (self._copies, 1)) for rng in self._rngs])
        return np.concatenate([own, np.full_like(own, step / HORIZON)], axis=-1)

    def reward(self, observations: np.ndarray, actions: np.ndarray) -> np.ndarray:
        return -((actions - self._targets * observations[..., :1]) ** 2).sum(-1)


def learn(learner: TRPO, world: Tracking, iterations: int) -> np.ndarray:
    """Act and learn; mean reward of each iteration and run."""
    history = []
    for _ in range(iterations):
        observations, total = world.observe(0), 0.0
        for step in range(1, HORIZON + 1):
            actions = learner.act(observations, explore=True)
            assert np.abs(actions).max() <= 1
            rewards = world.reward(observations, actions)
            next_observations = world.observe(step)
            learner.record(observations, actions, rewards, next_observations, step)
            observations = next_observations
            total = total + rewards.mean(-1) / HORIZON
        learner.end_iteration()
        history.append(total)
    return np.array(history)


def learner_of(runs: list[int]) -> TRPO:
    return TRPO(PARAMS, seed=7, runs=runs, observation_size=2, action_size=1, horizon=HORIZON)


def test_every_row_learns_its_own_task():
    runs = [0, 1, 2]
    learner, world = learner_of(runs), Tracking(runs)
    learn(learner, world, 120)
    observations = world.observe(2)
    error = world.reward(observations, learner.act(observations, explore=False))
    assert (error.mean(-1) > -0.01).all()  # within 0.1 of each row's own target


def test_a_row_in_lockstep_is_the_same_run_alone():
    together, alone = learner_of([0, 1, 2]), learner_of([1])
    rewards = learn(together, Tracking([0, 1, 2]), 7)
    np.testing.assert_allclose(rewards[:, 1], learn(alone, Tracking([1]), 7)[:, 0], rtol=1e-4)
    for name, weights in alone.policy().items():
        np.testing.assert_allclose(together.policy()[name][1], weights[0], rtol=1e-3, atol=1e-5)


def test_a_restored_learner_continues_bit_for_bit():
    learner, world = learner_of([0, 2]), Tracking([0, 2])
    learn(learner, world, 5)  # two policy steps, and half a batch waiting
    stored = save({name: np.ascontiguousarray(array) for name, array in learner.state().items()})
    rest = learn(learner, Tracking([0, 2]), 5)
    resumed = learner_of([0, 2])
    resumed.restore(load(stored))
    np.testing.assert_array_equal(learn(resumed, Tracking([0, 2]), 5), rest)
    for name, array in learner.state().items():
        np.testing.assert_array_equal(resumed.state()[name], array)


def test_rescored_rewards_replace_those_recorded():
    """One learner hears of its rewards step by step, the other when episodes have ended."""
    heard, told = learner_of([0, 1]), learner_of([0, 1])
    world, rng = Tracking([0, 1]), np.random.default_rng(0)
    observations = np.stack([world.observe(step) for step in range(HORIZON + 1)])
    known = np.zeros((2, 0, HORIZON), np.float32)
    for _ in range(4):
        rewards = rng.normal(size=(HORIZON, 2, 4)).astype(np.float32)
        for learner in (heard, told):
            for step in range(1, HORIZON + 1):
                learner.act(observations[step - 1], explore=True)
                now = rewards[step - 1] if learner is heard else 0 * rewards[step - 1]
                learner.record(observations[step - 1], np.zeros((2, 4, 1)), now, observations[step], step)
        known = np.concatenate([known, np.moveaxis(rewards, 0, -1)], axis=1)
        heard.end_iteration()
        told.end_iteration(known)
    np.testing.assert_array_equal(told.state()["theta"], heard.state()["theta"])
    assert (heard.state()["theta"] != learner_of([0, 1]).state()["theta"]).any()


def test_acting_without_exploration_changes_nothing():
    learner, other = learner_of([0]), learner_of([0])
    world, same = Tracking([0]), Tracking([0])
    learner.act(np.zeros((1, 4, 2)), explore=False)
    np.testing.assert_array_equal(learn(learner, world, 3), learn(other, same, 3))


def test_the_stored_policy_is_the_one_that_acts():
    learner, world = learner_of([0, 1]), Tracking([0, 1])
    learn(learner, world, 10)
    weights, observations = learner.policy(), world.observe(1)
    for row in range(2):
        hidden = np.tanh(observations[row] @ weights["weight0"][row] + weights["bias0"][row])
        action = np.clip(hidden @ weights["weight1"][row] + weights["bias1"][row], -1, 1)
        np.testing.assert_allclose(learner.act(observations, explore=False)[row], action, atol=1e-5)


def test_transitions_out_of_order_are_refused():
    learner = learner_of([0])
    observations = np.zeros((1, 4, 2))
    actions = learner.act(observations, explore=True)
    with pytest.raises(ValueError, match="out of order"):
        learner.record(observations, actions, np.zeros((1, 4)), observations, step=2)
    with pytest.raises(ValueError, match="0 of 6 steps"):
        learner.end_iteration()
