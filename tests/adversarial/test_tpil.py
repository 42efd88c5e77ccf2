"""TPIL: gradient reversal, the pair of frames, domain confusion, and wrong pushes in the expert's views."""

import numpy as np
import torch
from torch.nn import functional as F

from anyview.adversarial import tpil
from anyview.adversarial.tpil import PairDiscriminator, ReverseGradient, tpil_reward
from anyview.pusher.contexts import sample_contexts
from anyview.pusher.expert import roll_out
from anyview.pusher.render import renderer
from anyview.seeds import stream
from anyview.video.pixels import to_input
from tests.learners.toy import LAST, PARAMS, SIZE, clip_set, expert_motion, random_motion, show, squares


def batch_of(network: PairDiscriminator) -> dict:
    rng = np.random.default_rng(0)
    sets = {
        "expert": squares(expert_motion(3), ground=40),
        "bystander": squares(random_motion(3, 1), ground=40),
        "agent": squares(random_motion(3, 2), ground=120),
    }
    return {name: clip_set(clips).draw(rng, 6, network.lag) for name, clips in sets.items()}


def test_the_gradient_is_reversed_and_scaled():
    x = torch.tensor([1.0, -2.0], requires_grad=True)
    y = ReverseGradient.apply(x, 0.3)
    assert torch.equal(y, x)
    (y * torch.tensor([2.0, 5.0])).sum().backward()
    torch.testing.assert_close(x.grad, torch.tensor([-0.6, -1.5]))


def test_features_are_pushed_to_confuse_the_domain_head_that_itself_learns_to_tell():
    """Gradients of the whole loss, against those of the two cross-entropies taken apart."""
    torch.manual_seed(0)
    network = PairDiscriminator(SIZE, halved=True, domain_weight=0.5)
    batch = batch_of(network)
    features = list(network.features.parameters())
    head = list(network.domain_head.parameters())
    reversed_all = torch.autograd.grad(network.loss(batch), features + head)

    plain = {name: network.domain_head(network.features(views.now)) for name, views in batch.items()}
    view = torch.cat([plain["expert"], plain["bystander"]])
    domain = F.softplus(-view).mean() + F.softplus(plain["agent"]).mean()
    domain_gradients = torch.autograd.grad(domain, features + head)
    logits = {name: network.logits(views) for name, views in batch.items()}
    others = torch.cat([logits["agent"], logits["bystander"]])
    classes = F.softplus(-logits["expert"]).mean() + F.softplus(others).mean()
    class_gradients = torch.autograd.grad(classes, features)

    count = len(features)
    for whole, of_class, of_domain in zip(
        reversed_all[:count], class_gradients, domain_gradients[:count], strict=True
    ):
        torch.testing.assert_close(whole, of_class - 0.5 * of_domain, rtol=1e-4, atol=1e-6)
    for whole, of_domain in zip(reversed_all[count:], domain_gradients[count:], strict=True):
        torch.testing.assert_close(whole, of_domain)


def make(domain_weight: float = 0.2) -> tpil.LearnedReward:
    experts = [clip_set(squares(expert_motion(3), ground=40))]
    bystanders = [clip_set(squares(random_motion(8, 50), ground=40))]
    params = PARAMS.model_copy(update={"domain_weight": domain_weight})
    return tpil_reward(params, 3, [0], experts, bystanders)


def test_a_step_is_judged_with_the_frame_three_steps_before():
    reward = make()
    clip = squares(random_motion(1, 9))[None]
    earned = show(reward, clip)[0, 0]
    (network,) = reward.networks
    for t in range(1, LAST + 1):
        pair = [to_input(clip[0, :, max(t - 3, 1)]), to_input(clip[0, :, t])]
        features = torch.cat([network.features(frame) for frame in pair], dim=1)
        expected = network.class_head(features).item()
        np.testing.assert_allclose(earned[t - 1], expected, rtol=1e-4, atol=1e-6)


def test_it_prefers_the_experts_motion_in_a_view_where_it_never_saw_it():
    reward = make()
    for iteration in range(30):
        show(reward, squares(random_motion(4, iteration), ground=60)[None])
        measures = reward.end_iteration()
    assert set(measures) == {"expert_accuracy", "agent_accuracy", "bystander_accuracy", "domain_accuracy"}
    assert measures["expert_accuracy"][0] > 0.9
    assert measures["bystander_accuracy"][0] > 0.8
    expert = show(reward, squares(expert_motion(1), ground=60)[None]).mean()
    random = show(reward, squares(random_motion(20, 99), ground=60)[None]).mean()
    assert expert > random + 0.5


def test_bystanders_push_the_object_away_from_where_it_lies_and_from_where_the_expert_brings_it():
    contexts, _ = sample_contexts(stream(0, "test"), 12, "narrow")  # nothing else there is blue
    clips = tpil.wrong_pushes(contexts, np.random.default_rng(0), 64)
    assert clips.shape == (12, 50, 64, 64, 3)
    positions, _ = roll_out(contexts)
    expert = renderer("push", 64).render(contexts, positions[:, -1])
    start, end, goal = map(blue_centre, (clips[:, 0], clips[:, -1], expert))
    np.testing.assert_array_equal(clips[:, 0], renderer("push", 64).render(contexts, positions[:, 0]))
    assert np.linalg.norm(end - start, axis=-1).min() > 2  # pixels
    assert np.median(np.linalg.norm(end - goal, axis=-1)) > 6


def blue_centre(frames: np.ndarray) -> np.ndarray:
    """Where the object is in ``frames`` (N, H, W, 3): pixels (N, 2)."""
    red, green, blue = np.moveaxis(frames.astype(int), -1, 0)
    seen = blue > 1.5 * np.maximum(red, green)
    return np.stack([np.argwhere(each).mean(0) for each in seen])
