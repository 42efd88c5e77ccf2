"""The reward by optimal transport, against an assignment solved exactly and a literal evaluation."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment
from scipy.special import logsumexp

from anyview.config import RewardWeights
from anyview.learners.common.interfaces import RewardSource
from anyview.rewards.demonstration import DemonstrationReward, translate_demonstrations, translate_each
from anyview.rewards.transport import TransportReward, squared_distances, transport_plan
from anyview.video.pixels import to_input

WEIGHTS = RewardWeights(feature=1.0, image=0.7)


def episode(reward: RewardSource, clips: np.ndarray) -> np.ndarray:
    """What ``clips`` (R, C, 50, H, W, 3) earn in all."""
    return np.sum([reward.step(np.ascontiguousarray(clips[:, :, t]), t) for t in range(1, 50)], axis=0)


def test_a_plan_of_little_entropy_is_the_best_assignment() -> None:
    cost = torch.from_numpy(np.random.default_rng(0).uniform(size=(3, 8, 8)))
    plan = transport_plan(cost, 0.002, 500)
    torch.testing.assert_close(plan.sum(-1), torch.full((3, 8), 1 / 8, dtype=torch.float64))
    torch.testing.assert_close(
        plan.sum(-2), torch.full((3, 8), 1 / 8, dtype=torch.float64), atol=1e-4, rtol=0
    )
    for one, each in zip(cost.numpy(), plan.numpy(), strict=True):
        assert (one * each).sum() == pytest.approx(one[linear_sum_assignment(one)].mean(), abs=2e-3)


@given(st.integers(0, 2**32 - 1), st.floats(-2, 4))
def test_a_plan_is_that_of_iterations_of_logarithms(seed: int, magnitude: float) -> None:
    cost = 10**magnitude * np.random.default_rng(seed).uniform(size=(7, 5))
    potentials = np.zeros(7)
    for _ in range(30):
        of_columns = -np.log(5) - logsumexp(potentials[:, None] - cost / 0.05, axis=0)
        potentials = -np.log(7) - logsumexp(of_columns - cost / 0.05, axis=1)
    expected = np.exp(potentials[:, None] + of_columns - cost / 0.05)
    plan = transport_plan(torch.from_numpy(cost), 0.05, 3)
    np.testing.assert_allclose(plan.sum(-1), np.full(7, 1 / 7), rtol=1e-9)
    np.testing.assert_allclose(plan, expected, atol=1e-6)


def test_distances_are_those_between_all_pairs() -> None:
    rng = np.random.default_rng(1)
    one, other = rng.normal(size=(2, 3, 5, 7)), rng.normal(size=(2, 6, 4, 7))
    expected = ((one[:, :, None, :, None] - other[:, None, :, None]) ** 2).sum(-1)
    found = squared_distances(torch.from_numpy(one), torch.from_numpy(other))
    np.testing.assert_allclose(found.numpy(), expected)


def test_reward_is_the_mean_cost_of_the_plans(translator, expert_clips) -> None:
    demonstrations, first = expert_clips[:2], expert_clips[3:, 0]
    reward = TransportReward(translator, *translate_each(translator, demonstrations, first), first, WEIGHTS)
    acted = np.stack([expert_clips[3:], expert_clips[3:, ::-1]], axis=1)  # (R, C, 50, ...)
    total = episode(reward, acted)
    reward.end_iteration()
    earned = reward.rescored()
    assert earned.shape == (2, 2, 49)
    np.testing.assert_allclose(earned.sum(-1), total, rtol=1e-5)
    for run in range(2):
        seen = to_input(acted[run, 0, 1:])
        features, still = translator.encode_expert(seen), to_input(first[run][None])
        expected, costs = np.zeros(49), []
        for clip in demonstrations:
            target, image = (
                each[0] for each in translate_demonstrations(translator, clip[None], first[run : run + 1])
            )
            terms = (features, target, translator.encode_expert(still)), (seen, image, still)
            costs.append(
                [
                    (
                        ((one.flatten(1)[:, None] - goal.flatten(1)) ** 2).sum(-1).double(),
                        ((start.flatten(1) - goal.flatten(1)) ** 2).sum(-1).mean().double(),
                    )
                    for one, goal, start in terms
                ]
            )
        units = [np.mean([float(pair[term][1]) for pair in costs]) for term in range(2)]
        for (feature, _), (image, _) in costs:
            cost = (feature / units[0] + 0.7 * image / units[1]) / 1.7
            expected -= 49 / 2 * (transport_plan(cost, 0.05, 10) * cost).sum(-1).numpy()
        np.testing.assert_allclose(earned[run, 0], expected, rtol=2e-3, atol=2e-3)


@pytest.mark.parametrize("raw", [False, True])
def test_standing_still_earns_minus_one_a_step(translator, expert_clips, raw: bool) -> None:
    first = expert_clips[:, 0]
    weights = RewardWeights(feature=1.0, image=0.7, raw=raw)
    each = translate_each(translator, expert_clips[:3], first)
    still = np.repeat(first[:, None, None], 50, axis=2)
    np.testing.assert_allclose(
        episode(TransportReward(translator, *each, first, weights), still), -49, rtol=1e-3
    )


def test_another_tempo_costs_little_and_another_way_costs_much(translator, expert_clips) -> None:
    """Where steps are compared, a clip that lags costs much more."""
    first = expert_clips[:, 0]
    own = translator.expert_features(to_input(expert_clips[:, 1:].reshape(-1, *first.shape[1:])))
    features = own.unflatten(0, (len(first), 1, 49))
    images = to_input(expert_clips[:, None, 1:])
    reward = TransportReward(translator, features, images, first, WEIGHTS)
    same = episode(reward, expert_clips[:, None])
    slow = np.r_[0, np.round(np.interp(np.arange(1, 50), [1, 20, 49], [1, 12, 49])).astype(int)]
    lagging = episode(reward, expert_clips[:, None, slow])
    half = np.minimum(np.arange(50), 20)
    stopped = episode(reward, expert_clips[:, None, half])
    assert (same > -5).all()
    assert (stopped < lagging - 5).all()
    by_step = DemonstrationReward(translator, features[:, 0], images[:, 0], first, WEIGHTS, time_power=0.0)
    assert (lagging > 0.6 * episode(by_step, expert_clips[:, None, slow])).all()


def test_a_resumed_training_knows_what_episodes_earned(translator, expert_clips) -> None:
    first = expert_clips[3:, 0]
    each = translate_each(translator, expert_clips[:2], first)
    reward, resumed = (TransportReward(translator, *each, first, WEIGHTS) for _ in range(2))
    assert reward.state() == {}
    resumed.restore(reward.state())
    for clips in (expert_clips[3:, None], expert_clips[3:, None, ::-1]):
        episode(reward, clips)
        reward.end_iteration()
    resumed.restore(reward.state())
    assert np.array_equal(resumed.rescored(), reward.rescored())
    assert resumed.rescored().shape == (2, 2, 49)


def test_of_every_clip_the_mean_is_the_mean_demonstration(translator, expert_clips) -> None:
    first = expert_clips[3:, 0]
    shared = translate_each(translator, expert_clips[:3], first)
    own = translate_each(translator, np.stack([expert_clips[:3]] * 2), first)
    means = translate_demonstrations(translator, expert_clips[:3], first)
    for every, again, mean in zip(shared, own, means, strict=True):
        assert torch.equal(every, again)
        torch.testing.assert_close(every.mean(1), mean)
