"""The losses against NumPy, and what they teach."""

import numpy as np
import pytest
import torch
from torch.nn import functional as F

from anyview.config import LossWeights
from anyview.translator.architectures import embed_task
from anyview.translator.losses import alignment_loss, batch_losses, frame_loss
from anyview.translator.network import ContextTranslator

ONE = LossWeights(translation=1.0, reconstruction=1.0, alignment=1.0)


@pytest.fixture
def model() -> ContextTranslator:
    torch.manual_seed(0)
    return ContextTranslator("compact", 16)


@pytest.fixture
def batch() -> tuple[torch.Tensor, ...]:
    """Six pairs of frames, the expert's before the target's, and the six contexts."""
    return tuple(torch.rand(18, 3, 16, 16).mul(2).sub(1).split((12, 6)))


def test_frame_loss_is_half_the_squares_of_a_batch_of_a_hundred():
    rng = np.random.default_rng(0)
    output, target = rng.uniform(-1, 1, (2, 100, 3, 4, 4))
    expected = 0.5 * ((output - target) ** 2).sum()
    assert frame_loss(torch.tensor(output), torch.tensor(target)).item() == pytest.approx(expected, rel=1e-6)
    part = frame_loss(torch.tensor(output[:10]), torch.tensor(target[:10])).item()
    assert part == pytest.approx(10 * 0.5 * ((output[:10] - target[:10]) ** 2).sum(), rel=1e-6)


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
def test_the_gradient_of_the_frame_loss_is_the_scaled_difference(dtype):
    output = torch.randn(10, 3, 4, 4).to(dtype).requires_grad_()
    target = torch.randn(10, 3, 4, 4)
    (gradient,) = torch.autograd.grad(3 * frame_loss(output, target), output)
    assert gradient.dtype == dtype
    expected = 3 * 2 * (100 / 2 / 10) * (output.detach().double() - target.double())
    torch.testing.assert_close(
        gradient.double(), expected, rtol=1e-2 if dtype == torch.bfloat16 else 1e-5, atol=1e-5
    )


def test_alignment_loss_is_a_thousand_times_the_mean_square():
    rng = np.random.default_rng(1)
    z3, z = rng.normal(size=(2, 30, 8))
    expected = 1000 * ((z3 - z) ** 2).mean()
    assert alignment_loss(torch.tensor(z3), torch.tensor(z)).item() == pytest.approx(expected, rel=1e-6)


def test_losses_compare_what_the_equations_say(model, batch):
    """L_tr, L_rec and L_align from the network's parts, called one by one as the equations write them."""
    (expert, target), context = batch[0].chunk(2), batch[1]
    with torch.no_grad():
        found = batch_losses(model, *batch)
        z2, skips = model.encode_context(context)
        z3 = model.translate(model.encode_expert(expert), z2)
        z_true = model.encode_expert(target)
        translated, reconstructed = model.decode(z3, skips), model.decode(z_true, skips)
    scale = 100 / len(target)
    assert found.translation.item() == pytest.approx(
        scale * 0.5 * float(((translated - target) ** 2).sum()), rel=1e-4
    )
    assert found.reconstruction.item() == pytest.approx(
        scale * 0.5 * float(((reconstructed - target) ** 2).sum()), rel=1e-4
    )
    assert found.alignment.item() == pytest.approx(1000 * float(F.mse_loss(z3, z_true)), rel=1e-4)
    weights = LossWeights(translation=2.0, reconstruction=0.5, alignment=3.0)
    expected = 2 * found.translation + 0.5 * found.reconstruction + 3 * found.alignment
    assert found.total(weights).item() == pytest.approx(expected.item())


@pytest.mark.parametrize(
    ("off", "untouched", "touched"),
    [
        (
            ("translation", "alignment"),
            ("translation.",),
            ("expert_encoder.", "context_encoder.convolutions"),
        ),
        (("translation", "reconstruction"), ("decoder.",), ("translation.", "context_encoder.output")),
        (("reconstruction", "alignment"), (), ("translation.", "decoder.", "expert_encoder.")),
        (("translation",), (), ("translation.", "decoder.")),
        (("reconstruction",), (), ("translation.", "decoder.")),
        (("alignment",), (), ("translation.", "decoder.")),
    ],
)
def test_gradients_come_from_the_losses_that_are_on(model, batch, off, untouched, touched):
    """A loss that is off changes no gradient: the rest equals the gradient of the other losses' sum."""
    weights = LossWeights(
        **{name: float(name not in off) for name in ("translation", "reconstruction", "alignment")}
    )
    named = dict(model.named_parameters())
    total = batch_losses(model, *batch, wanted=weights).total(weights)
    gradients = dict(zip(named, torch.autograd.grad(total, named.values(), allow_unused=True), strict=True))
    for name, gradient in gradients.items():
        if name.startswith(untouched) and untouched:
            assert gradient is None or not gradient.any(), name
        if name.startswith(touched):
            assert gradient is not None, name
            assert gradient.any(), name
    found = batch_losses(model, *batch)
    expected = sum(
        getattr(found, name) for name in ("translation", "reconstruction", "alignment") if name not in off
    )
    for name, gradient in zip(
        named, torch.autograd.grad(expected, named.values(), allow_unused=True), strict=True
    ):
        if gradients[name] is not None:
            torch.testing.assert_close(gradients[name], gradient, rtol=1e-4, atol=1e-4)


def test_a_loss_that_is_off_is_not_computed(model, batch):
    found = batch_losses(
        model, *batch, wanted=LossWeights(translation=1.0, reconstruction=0.0, alignment=0.0)
    )
    assert found.reconstruction is None
    assert found.alignment is None
    assert [bool(torch.isnan(part)) for part in found.parts()] == [False, True, True]


def test_the_task_embedding_is_the_mean_of_enc1_over_the_clip(batch):
    torch.manual_seed(3)
    model = ContextTranslator("compact", 16, task_embedding=True)
    (expert, target), context, clip = batch[0].chunk(2), batch[1], torch.rand(6, 8, 3, 16, 16)
    with torch.no_grad():
        z2, skips = model.encode_context(context)
        task = sum(model.encode_expert(clip[:, k]) for k in range(8)) / 8
        z1 = model.encode_expert(expert)
        hidden = F.linear(torch.cat((z1, z2, task), 1), *model.translation.hidden.parameters())
        z3 = F.linear(F.leaky_relu(hidden, 0.2), *model.translation.output.parameters())
        translated = model.decode(z3, skips)
    found = batch_losses(model, *batch, clip)
    assert found.translation.item() == pytest.approx(frame_loss(translated, target).item(), rel=1e-4)
    # Another clip is another task, for the translation alone.
    other = batch_losses(model, *batch, clip.flip(3))
    assert other.translation.item() != found.translation.item()
    assert other.reconstruction.item() == found.reconstruction.item()


def test_a_clip_is_embedded_by_the_middles_of_equal_parts():
    model = ContextTranslator("compact", 16, task_embedding=True)
    z1 = torch.randn(48, 256)
    torch.testing.assert_close(embed_task(model, z1), z1[3::6].mean(0, keepdim=True))
    assert embed_task(model, z1[:3]).shape == (1, 256)
    assert embed_task(ContextTranslator("compact", 16), z1) is None
