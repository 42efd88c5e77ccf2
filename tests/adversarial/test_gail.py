"""GAIL: its loss and reward by hand, what it learns, and that runs do not mix."""

import numpy as np
import pytest
import torch
from safetensors.numpy import load, save

from anyview.adversarial.common.discriminators import LearnedReward
from anyview.adversarial.gail import FrameDiscriminator, gail_reward
from tests.learners.toy import LAST, PARAMS, SIZE, clip_set, expert_motion, random_motion, show, squares


def make(runs: list[int]) -> LearnedReward:
    experts = [clip_set(squares(expert_motion(3)))] * len(runs)
    return gail_reward(PARAMS, seed=3, runs=runs, experts=experts)


def agents(runs: list[int], iteration: int, copies: int = 2) -> np.ndarray:
    """Random motion (R, C, T + 1, H, W, 3), another for each run and iteration."""
    return np.stack([squares(random_motion(copies, 100 * run + iteration)) for run in runs])


def practise(reward: LearnedReward, runs: list[int], iterations: range) -> list[np.ndarray]:
    earned = []
    for iteration in iterations:
        earned.append(show(reward, agents(runs, iteration)))
        reward.end_iteration()
    return earned


def test_loss_is_that_of_the_paper():
    torch.manual_seed(0)
    network = FrameDiscriminator(SIZE, halved=True)
    rng = np.random.default_rng(0)
    batch = {
        "expert": clip_set(squares(expert_motion(3))).draw(rng, 5, 0),
        "agent": clip_set(squares(random_motion(3, 1))).draw(rng, 7, 0),
    }
    d = {
        name: 1 / (1 + np.exp(-network.logits(views).detach().double().numpy()))
        for name, views in batch.items()
    }
    expected = -np.log(d["expert"]).mean() - np.log(1 - d["agent"]).mean()
    assert network.loss(batch).item() == pytest.approx(expected, rel=1e-5)


def test_it_learns_to_prefer_the_expert_to_the_agent():
    runs = [0, 1]
    reward = make(runs)
    practise(reward, runs, range(24))
    expert = show(reward, np.stack([squares(expert_motion(2))] * 2))
    random = show(reward, agents(runs, 99))
    measures = reward.end_iteration()
    assert (expert.mean((1, 2)) > random.mean((1, 2)) + 1).all()
    assert (measures["expert_accuracy"] > 0.9).all()
    assert (measures["agent_accuracy"] > 0.6).all()  # random motion is at times where the expert is


def test_it_sees_when_a_frame_comes_too_late():
    """Frames of the expert at other times: only the time index tells them from the expert's."""
    reward = make([0])
    late = squares(np.roll(expert_motion(2), 4, axis=1))[None]
    for _ in range(40):
        show(reward, late)
        measures = reward.end_iteration()
    in_time = show(reward, squares(expert_motion(2))[None])
    assert in_time.mean() > 1
    assert show(reward, late).mean() < -1
    assert measures["agent_accuracy"][0] > 0.9


def test_the_newest_episodes_are_rescored_by_what_it_has_learned_since():
    reward = make([0, 1])
    clips = [agents([0, 1], iteration) for iteration in range(5)]  # of 2 episodes each
    earned = []
    for each in clips:
        earned.append(show(reward, each))
        reward.end_iteration()
    rescored = reward.rescored()
    now = np.concatenate([show(reward, each) for each in clips[3:]], axis=1)
    np.testing.assert_allclose(rescored, now, rtol=1e-4, atol=1e-6)
    assert (rescored[:, :2] != earned[3]).any()


def test_a_run_among_others_is_the_same_run_alone():
    together = practise(make([0, 1, 2]), [0, 1, 2], range(6))
    alone = practise(make([1]), [1], range(6))
    for one, other in zip(together, alone, strict=True):
        np.testing.assert_allclose(one[1], other[0], rtol=1e-4, atol=1e-6)


def test_a_restored_reward_continues_bit_for_bit():
    runs = [0, 2]
    reward = make(runs)
    practise(reward, runs, range(5))
    stored = save({name: np.ascontiguousarray(array) for name, array in reward.state().items()})
    rest = practise(reward, runs, range(5, 9))
    resumed = make(runs)
    resumed.restore(load(stored))
    for one, other in zip(practise(resumed, runs, range(5, 9)), rest, strict=True):
        np.testing.assert_array_equal(one, other)


def test_the_return_table_can_be_asked_after_training():
    """Clips of another number of copies, shown without ending an iteration, leave no trace."""
    reward, same = make([0]), make([0])
    practise(reward, [0], range(2))
    practise(same, [0], range(2))
    show(reward, squares(expert_motion(1))[None])
    for one, other in zip(practise(reward, [0], range(2, 4)), practise(same, [0], range(2, 4)), strict=True):
        np.testing.assert_array_equal(one, other)


def test_draws_are_of_every_clip_and_of_times_after_the_first_frame():
    columns = np.arange(3)[:, None] + np.zeros((3, LAST + 1))
    clips = squares(columns)
    clips[:, 0] = 0  # o_0 is black
    drawn = clip_set(clips).draw(np.random.default_rng(0), 200, lag=3)
    assert drawn.now.flatten(1).max(1).values.min() > 0.9
    assert drawn.before.flatten(1).max(1).values.min() > 0.9
    assert set((drawn.time * LAST).round().int().tolist()) == set(range(1, LAST + 1))
    assert len({tuple(frame.flatten().tolist()) for frame in drawn.now}) == 3
