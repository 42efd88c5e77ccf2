"""What both discriminators share: the penalty on their gradients, by hand and in training, and shifts."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor, nn

from anyview.adversarial.common.discriminators import Discriminator, Views, gradient_penalty, shifted
from anyview.adversarial.gail import FrameDiscriminator, gail_reward
from anyview.adversarial.tpil import PairDiscriminator
from tests.learners.toy import PARAMS, SIZE, clip_set, expert_motion, random_motion, show, squares

NETWORKS = {
    "gail": lambda: FrameDiscriminator(SIZE, halved=True),
    "gail, whole frames": lambda: FrameDiscriminator(SIZE, halved=False),
    "tpil": lambda: PairDiscriminator(SIZE, halved=True, domain_weight=0.2),
    "tpil, whole frames": lambda: PairDiscriminator(SIZE, halved=False, domain_weight=0.2),
}


class Quadratic(Discriminator):
    """Logits a |o_t|^2 / 2 + b sum(o_(t - lag)), whose gradients are a o_t and b everywhere."""

    lag = 3

    def __init__(self) -> None:
        super().__init__()
        self.weights = nn.Parameter(torch.tensor([0.7, -0.2]))

    def logits(self, views: Views) -> Tensor:
        a, b = self.weights
        return a * views.now.flatten(1).square().sum(1) / 2 + b * views.before.flatten(1).sum(1)


def batch_of(count: int, lag: int) -> Views:
    return clip_set(squares(random_motion(3, 1))).draw(np.random.default_rng(0), count, lag)


def test_the_penalty_is_the_mean_square_of_the_gradient_and_trains_the_network():
    network, batches = Quadratic(), [batch_of(5, lag=3), batch_of(7, lag=3)]
    penalty = gradient_penalty(network, batches)
    size = 3 * SIZE**2
    frames = torch.cat([views.now for views in batches]).double()
    square = frames.square().flatten(1).sum(1).mean().item()
    assert penalty.item() == pytest.approx(0.7**2 * square + 0.2**2 * size, rel=1e-5)
    penalty.backward()
    np.testing.assert_allclose(network.weights.grad, [2 * 0.7 * square, 2 * -0.2 * size], rtol=1e-5)


@pytest.mark.parametrize("name", NETWORKS)
def test_the_penalty_matches_differences_of_the_logits(name: str):
    torch.manual_seed(0)
    network = NETWORKS[name]().double()
    now = torch.rand(1, 3, SIZE, SIZE, dtype=torch.float64) * 2 - 1
    before, time = now.flip(3) if network.lag else now, torch.tensor([0.5], dtype=torch.float64)
    count, step = now.numel(), 1e-6
    nudges = step * torch.eye(count, dtype=torch.float64).view(count, *now.shape[1:])

    def slopes(before_nudges: Tensor, now_nudges: Tensor) -> Tensor:
        ahead, behind = (
            network.logits(Views(before + sign * before_nudges, now + sign * now_nudges, time.expand(count)))
            for sign in (1, -1)
        )
        return (ahead - behind) / (2 * step)

    still = torch.zeros_like(nudges)
    expected = slopes(nudges, still).square().sum() + slopes(still, nudges).square().sum()
    penalty = gradient_penalty(network, [Views(before, now, time)]).item()
    assert penalty == pytest.approx(expected.item(), rel=1e-4)


def test_with_the_penalty_logits_of_expert_and_agent_stay_close():
    spread = {}
    for weight in (0.0, 10.0):
        params = PARAMS.model_copy(update={"gradient_penalty": weight})
        reward = gail_reward(params, 3, [0], [clip_set(squares(expert_motion(3)))])
        agent = squares(random_motion(2, 7))[None]
        for _ in range(12):
            show(reward, agent)
            reward.end_iteration()
        expert = show(reward, squares(expert_motion(2))[None])
        spread[weight] = expert.mean() - show(reward, agent).mean()
    assert 0 < spread[10.0] < spread[0.0] / 2


@given(most=st.integers(0, 3), seed=st.integers(0, 99))
def test_a_shift_moves_both_frames_of_a_view_alike_and_repeats_borders(most: int, seed: int):
    """The pixel at a place is what was there before the shift, or at the nearest place in the frame."""
    views = batch_of(6, lag=3)
    moved = shifted(views, most, np.random.default_rng(seed))
    assert torch.equal(moved.time, views.time)
    places, offsets = np.arange(SIZE), range(-most, most + 1)

    def at(frame: Tensor, x: int, y: int) -> Tensor:
        return frame[:, (places + y).clip(0, SIZE - 1)][:, :, (places + x).clip(0, SIZE - 1)]

    for before, now, after, seen in zip(views.before, views.now, moved.before, moved.now, strict=True):
        assert any(
            torch.equal(seen, at(now, x, y)) and torch.equal(after, at(before, x, y))
            for x in offsets
            for y in offsets
        )


def test_shifts_are_drawn_for_every_view():
    """A square in the middle of equal frames ends up in several places."""
    frames = torch.zeros(40, 3, SIZE, SIZE)
    frames[:, :, 8, 8] = 1.0
    moved = shifted(Views(frames, frames, torch.zeros(40)), 1, np.random.default_rng(0))
    assert {divmod(int(frame[0].argmax()), SIZE) for frame in moved.now} == {
        (y, x) for y in (7, 8, 9) for x in (7, 8, 9)
    }
