"""The reward against a slow, literal evaluation of equations 20 to 22."""

import numpy as np
import pytest
import torch

from anyview.config import Incomplete, RewardWeights
from anyview.rewards.demonstration import (
    DemonstrationReward,
    frames_there,
    hold,
    translate_clock,
    translate_demonstrations,
    true_demonstrations,
)
from anyview.translator.keypoints.codes import KEYPOINTS
from anyview.translator.keypoints.translator import KeypointTranslator
from anyview.translator.network import ContextTranslator
from anyview.video.pixels import to_frames, to_input


def literal(
    model: ContextTranslator, demonstrations: np.ndarray, first: np.ndarray, frame: np.ndarray, t: int
) -> tuple[float, float]:
    """L_f and L_i of one ``frame`` at ``t``, one demonstration and one network call at a time."""
    z2, skips = model.encode_context(to_input(first[None]))
    features, images = [], []
    for clip in demonstrations:
        z3 = model.translate(model.encode_expert(to_input(clip[t][None])), z2)
        features.append(z3[0].numpy().astype(np.float64))
        images.append(model.decode(z3, skips)[0].numpy().astype(np.float64))
    z = model.encode_expert(to_input(frame[None]))[0].numpy().astype(np.float64)
    pixels = frame.transpose(2, 0, 1).astype(np.float64) / 127.5 - 1
    feature, image = sum(features) / len(features), sum(images) / len(images)
    return -((z - feature) ** 2).sum(), -((pixels - image) ** 2).sum()


@pytest.mark.parametrize(
    ("feature", "image", "power", "raw"),
    [
        (True, True, 0.0, False),
        (True, True, 2.0, False),
        (True, False, 0.0, False),
        (False, True, 1.0, False),
        (True, True, 0.0, True),
        (True, True, 2.0, True),
        (True, False, 0.0, True),
        (False, True, 1.0, True),
    ],
)
def test_reward_is_the_equations(
    translator, expert_clips, feature: bool, image: bool, power: float, raw: bool
) -> None:
    demonstrations, first = expert_clips[:3], expert_clips[3:, 0]
    weights = RewardWeights(feature=1.0 if feature else 0.0, image=0.3 if image else 0.0, raw=raw)
    targets = translate_demonstrations(translator, demonstrations, first)
    reward = DemonstrationReward(translator, *targets, first, weights, power)
    # Standing still, term by term: the units.
    still = np.zeros((2, 2))
    for run in range(2):
        for t in range(1, 50):
            still[run] -= np.multiply(
                (t / 49) ** power, literal(translator, demonstrations, first[run], first[run], t)
            )
    still /= 49
    for t in (1, 30, 49):
        frames = np.stack([expert_clips[3:, t], expert_clips[3:, 49 - t]], axis=1)  # (R, C, ...)
        got = reward.step(frames, t)
        for run in range(2):
            for copy in range(2):
                l_f, l_i = literal(translator, demonstrations, first[run], frames[run, copy], t)
                phi = 0.3 if image else 0.0
                costs = np.ones(2) if raw else still[run]
                terms = (l_f / costs[0] if feature else 0.0) + phi * l_i / costs[1]
                whole = (still[run] / costs * [float(feature), phi]).sum()  # what standing still costs
                np.testing.assert_allclose(got[run, copy], (t / 49) ** power * terms / whole, rtol=1e-4)
                # In the equations' own units: L_f + phi' L_i, or L_i alone.
                ratio = phi * costs[0] / costs[1]
                plain = l_f + ratio * l_i if feature else l_i
                np.testing.assert_allclose(
                    got[run, copy] * reward.scales[run], (t / 49) ** power * plain, rtol=1e-4
                )


@pytest.mark.parametrize("raw", [False, True])
def test_standing_still_earns_minus_one_a_step(translator, expert_clips, raw: bool) -> None:
    first = expert_clips[:, 0]
    weights = RewardWeights(feature=1.0, image=0.7, raw=raw)
    for targets in (
        translate_demonstrations(translator, expert_clips[:3], first),
        true_demonstrations(translator, expert_clips),
    ):
        reward = DemonstrationReward(translator, *targets, first, weights, time_power=1.0)
        returns = sum(reward.step(first[:, None], t) for t in range(1, 50))
        np.testing.assert_allclose(returns, -49, rtol=1e-4)


def test_the_oracle_s_optimum_is_the_experts_own_motion(translator, expert_clips) -> None:
    targets = true_demonstrations(translator, expert_clips)
    weights = RewardWeights(feature=1.0, image=0.3)
    reward = DemonstrationReward(translator, *targets, expert_clips[:, 0], weights, time_power=0.0)
    np.testing.assert_array_equal(reward.targets(), expert_clips)
    for t in (1, 25, 49):
        same = reward.step(expert_clips[:, None, t], t)
        other = reward.step(expert_clips[:, None, t - 20], t)
        np.testing.assert_allclose(same, 0, atol=1e-6)
        assert (other < same - 1e-3).all()


def test_batches_do_not_change_a_translation(translator, expert_clips) -> None:
    alone = translate_demonstrations(translator, expert_clips[:2], expert_clips[3:4, 0])
    together = translate_demonstrations(translator, expert_clips[:2], expert_clips[2:5, 0])
    for one, many in zip(alone, together, strict=True):
        torch.testing.assert_close(one[0], many[1], atol=1e-5, rtol=1e-5)


def test_the_clock_translates_the_mean_of_the_features(translator, expert_clips) -> None:
    """And the mean of one clip is that clip."""
    clips, first = expert_clips[:3], expert_clips[3:, 0]
    features, images = translate_clock(translator, clips, first)
    for t in (1, 49):
        z1 = sum(translator.encode_expert(to_input(clip[t][None])) for clip in clips) / 3
        z2, skips = translator.encode_context(to_input(first[1][None]))
        z3 = translator.translate(z1, z2)
        torch.testing.assert_close(features[1, t - 1], z3[0], rtol=1e-4, atol=1e-5)
        torch.testing.assert_close(images[1, t - 1], translator.decode(z3, skips)[0], rtol=1e-4, atol=1e-5)
    alone = (
        translate(translator, clips[:1], first) for translate in (translate_clock, translate_demonstrations)
    )
    for one, other in zip(*alone, strict=True):
        torch.testing.assert_close(one, other)


@pytest.mark.parametrize("task_embedding", [True, False])
def test_a_task_embedding_is_of_the_whole_clip(expert_clips, task_embedding: bool) -> None:
    """The same frame, in a clip that ends elsewhere, is translated otherwise."""
    torch.manual_seed(0)
    model = ContextTranslator("compact", 32, task_embedding).eval().requires_grad_(False)
    clips, first = expert_clips[:1].copy(), expert_clips[3:, 0]
    before, _ = translate_demonstrations(model, clips, first)
    clips[:, 40:] = expert_clips[1, 40:]
    after, _ = translate_demonstrations(model, clips, first)
    assert torch.equal(before[:, 5], after[:, 5]) != task_embedding


def test_of_keypoints_only_their_places_are_compared(expert_clips) -> None:
    """By the equation, and whatever the rest of the code says."""
    torch.manual_seed(0)
    model = KeypointTranslator(32).eval().requires_grad_(False)
    model.encoder.heat.weight.mul_(30)  # so that places differ
    clips, first, frame = expert_clips[:2], expert_clips[3:, 0], expert_clips[4, 20]

    def feature_loss() -> float:
        targets = translate_demonstrations(model, clips, first)
        reward = DemonstrationReward(model, *targets, first, RewardWeights(feature=1.0, image=0.0), 0.0)
        seen = np.stack([first[0], frame])[:, None]
        return float(reward.step(seen, 30)[1, 0] * reward.scales[1])

    z2, _ = model.encode_context(to_input(first[1:2]))
    codes = [model.encode_expert(to_input(clip[[0, 30]])) for clip in clips]
    moved = [model.translate(z1[1:], z2, z1[:1])[0, : 2 * KEYPOINTS] for z1 in codes]
    found = model.encode_expert(to_input(frame[None]))[0, : 2 * KEYPOINTS]
    assert feature_loss() == pytest.approx(-float((found - sum(moved) / 2).square().sum()), rel=1e-4)
    before = feature_loss()
    model.translation.steps.bias[2 * KEYPOINTS :] += 1
    assert feature_loss() == before


def test_each_agent_may_have_clips_of_its_own(translator, expert_clips) -> None:
    own = np.stack([expert_clips[:2], expert_clips[1:3]])
    together = translate_demonstrations(translator, own, expert_clips[3:, 0])
    for run in range(2):
        alone = translate_demonstrations(translator, own[run], expert_clips[3 + run : 4 + run, 0])
        for one, many in zip(alone, together, strict=True):
            assert torch.equal(one[0], many[run])


@pytest.mark.parametrize(
    ("incomplete", "steps"),
    [
        ({}, range(50)),
        ({"every": 12}, [0, 12, 24, 36, 48]),
        ({"every": 48}, [0, 48]),
        ({"until": 0.67}, range(33)),
        ({"every": 7, "until": 0.5}, [0, 7, 14, 21]),
    ],
)
def test_frames_of_a_clip_that_there_are(incomplete, steps) -> None:
    assert list(np.flatnonzero(frames_there(50, Incomplete(**incomplete)))) == list(steps)


def test_incomplete_clips_reward_only_where_a_frame_is(translator, expert_clips) -> None:
    """What the missing frames show is in no target and no reward; standing still earns as ever."""
    there = frames_there(50, Incomplete(every=12))
    clips, first = expert_clips[:2], expert_clips[3:, 0]
    other = clips.copy()
    other[:, ~there] = np.random.default_rng(0).integers(0, 256, other[:, ~there].shape)
    weights = RewardWeights(feature=1.0, image=0.7)
    rewards = [
        DemonstrationReward(
            translator,
            *translate_demonstrations(translator, hold(shown, there), first),
            first,
            weights,
            1.0,
            there,
        )
        for shown in (clips, other)
    ]
    complete = translate_demonstrations(translator, clips, first)
    np.testing.assert_array_equal(rewards[0].targets()[:, 24], to_frames(complete[1])[:, 23])
    np.testing.assert_array_equal(rewards[0].targets(), rewards[1].targets())
    seen = expert_clips[3:, None]
    given = np.stack([[reward.step(seen[:, :, t], t)[:, 0] for t in range(1, 50)] for reward in rewards])
    np.testing.assert_array_equal(given[0], given[1])
    assert ((given[0] != 0).all(axis=1) == there[1:]).all()
    assert (given[0][~there[1:]] == 0).all()
    np.testing.assert_allclose(sum(rewards[0].step(first[:, None], t) for t in range(1, 50)), -49, rtol=1e-4)
