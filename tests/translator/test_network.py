"""The architectures, layer by layer, against the table of the thesis."""

import copy

import pytest
import torch
from torch.nn import functional as F

from anyview.runtime.errors import AnyviewError
from anyview.translator.architectures import make_translator
from anyview.translator.network import ContextTranslator

# Per architecture: image size, width, convolutions (in, out, map size), fractional ones (in with skip, out).
LAYERS = {
    "real": (
        48,
        100,
        [(3, 32, 48), (32, 16, 24), (16, 16, 24), (16, 8, 12)],
        [(8 + 8, 16, 24), (16 + 16, 16, 24), (16 + 16, 32, 48), (32 + 32, 3, 48)],
    ),
    "sim": (
        64,
        1024,
        [(3, 64, 32), (64, 128, 16), (128, 256, 8), (256, 512, 4)],
        [(512 + 512, 256, 8), (256 + 256, 128, 16), (128 + 128, 64, 32), (64 + 64, 3, 64)],
    ),
    "compact": (
        64,
        256,
        [(3, 16, 32), (16, 32, 16), (32, 64, 8), (64, 128, 4)],
        [(128 + 128, 64, 8), (64 + 64, 32, 16), (32 + 32, 16, 32), (16 + 16, 3, 64)],
    ),
}


def parameters(module: torch.nn.Module) -> int:
    return sum(parameter.numel() for parameter in module.parameters())


@pytest.fixture(scope="module", params=LAYERS)
def model(request) -> ContextTranslator:
    torch.manual_seed(0)
    return ContextTranslator(request.param, LAYERS[request.param][0])


def test_every_layer_has_the_shape_of_the_table(model):
    size, width, convolutions, fractional = LAYERS[model.architecture]
    frames = torch.rand(2, 3, size, size) * 2 - 1
    with torch.no_grad():
        z1 = model.encode_expert(frames)
        z2, maps = model.encode_context(frames)
        z3 = model.translate(z1, z2)
        terms = model.decoder.skip_terms(maps)
        assert z1.shape == z2.shape == z3.shape == (2, width)
        assert [tuple(m.shape[1:]) for m in maps] == [(out, side, side) for _, out, side in convolutions]
        assert [tuple(s.map.shape[1:]) for s in terms] == [
            (out, side, side) for _, out, side in fractional_maps(model)
        ]
        assert model.decode(z3, maps).shape == (2, 3, size, size)
    assert [tuple(c.weight.shape) for c in model.context_encoder.convolutions] == [
        (out, before, 5, 5) for before, out, _ in convolutions
    ]
    assert [tuple(c.weight.shape) for c in model.decoder.convolutions] == [
        (before, out, 5, 5) for before, out, _ in fractional
    ]


def fractional_maps(model: ContextTranslator) -> list[tuple[int, int, int]]:
    return LAYERS[model.architecture][3]


def test_parameter_counts(model):
    _, width, convolutions, fractional = LAYERS[model.architecture]
    _, last, side = convolutions[-1]
    encoder = sum(25 * before * out + out for before, out, _ in convolutions)
    encoder += (last * side**2 + 1) * width + (width + 1) * width
    translation = (2 * width + 1) * width + (width + 1) * width
    decoder = (width + 1) * last * side**2 + sum(25 * before * out + out for before, out, _ in fractional)
    assert parameters(model.expert_encoder) == encoder
    assert parameters(model.translation) == translation
    assert parameters(model.decoder) == decoder
    encoders = 1 if model.architecture == "real" else 2
    assert parameters(model) == encoders * encoder + translation + decoder


def test_only_the_real_architecture_shares_its_encoders(model):
    frames = torch.rand(2, 3, model.image_size, model.image_size)
    same = torch.equal(model.encode_expert(frames), model.encode_context(frames)[0])
    assert same == model.shared == (model.architecture == "real")


def decode_as_stated(model: ContextTranslator, z: torch.Tensor, maps: list[torch.Tensor]) -> torch.Tensor:
    """The layers as the thesis states them: concatenate, convolve, LeakyReLU 0.2, linear frame."""
    return convolve_as_stated(model, F.leaky_relu(model.decoder.hidden(z), 0.2), maps)


def convolve_as_stated(
    model: ContextTranslator, hidden: torch.Tensor, maps: list[torch.Tensor]
) -> torch.Tensor:
    fractional = LAYERS[model.architecture][3]
    channels, side = maps[-1].shape[1:3]
    x = hidden.view(-1, side, side, channels).permute(0, 3, 1, 2)
    for index, (layer, skip) in enumerate(zip(model.decoder.convolutions, maps[::-1], strict=True)):
        stride = fractional[index][2] // x.shape[-1]
        x = torch.cat((x, skip), dim=1)
        x = F.conv_transpose2d(x, layer.weight, layer.bias, stride, padding=2, output_padding=stride - 1)
        x = F.leaky_relu(x, 0.2) if index < 3 else x
    return x


def test_decoder_is_fractional_convolution_over_concatenated_skips(model):
    """The same picture, and the same gradient of every weight, of the features and of the skips.

    In double precision: in single, an activation next to LeakyReLU's kink may fall on either side of it.
    """
    model = copy.deepcopy(model).double()
    frames = torch.rand(3, 3, model.image_size, model.image_size, dtype=torch.float64)
    with torch.no_grad():
        z2, maps = model.encode_context(frames)
    learned = [z2, *maps, *model.decoder.parameters()]
    for tensor in learned:
        tensor.requires_grad_()
    ours, stated = model.decode(z2, maps), decode_as_stated(model, z2, maps)
    torch.testing.assert_close(ours, stated, rtol=1e-4, atol=1e-5)
    target = torch.rand_like(stated)
    gradients = [torch.autograd.grad(((x - target) ** 2).sum(), learned) for x in (ours, stated)]
    for found, expected in zip(*gradients, strict=True):
        torch.testing.assert_close(found, expected, rtol=1e-4, atol=1e-4 * expected.abs().max().item())


def test_one_context_serves_many_frames(model):
    frames = torch.rand(6, 3, model.image_size, model.image_size)
    with torch.no_grad():
        z1 = model.encode_expert(frames)
        _, maps = model.encode_context(frames[:2])
        together = model.decode(z1, maps)
        for row in range(6):
            alone = model.decode(z1[row : row + 1], [m[row % 2 : row % 2 + 1] for m in maps])
            torch.testing.assert_close(together[row : row + 1], alone, rtol=1e-4, atol=1e-5)


def test_dropout_is_on_the_inputs_of_all_connected_layers_of_real_and_behind_the_decoder_s():
    """The layers one by one, each with a mask of its own: half of its inputs 0, the others doubled."""
    torch.manual_seed(0)
    model = ContextTranslator("real", 48)
    frames = torch.rand(64, 3, 48, 48)
    masks = torch.Generator().manual_seed(1)

    def dropped(x: torch.Tensor) -> torch.Tensor:
        kept = torch.empty_like(x).bernoulli_(0.5, generator=masks)
        assert kept.mean().item() == pytest.approx(0.5, abs=0.03)
        return 2 * kept * x

    def connected(layers, x: torch.Tensor) -> torch.Tensor:
        return layers.output(dropped(F.leaky_relu(layers.hidden(dropped(x)), 0.2)))

    with torch.no_grad():
        maps = model.encode_context(frames)[1]
        z1 = connected(model.expert_encoder, maps[-1].permute(0, 2, 3, 1).flatten(1))
        z3 = connected(model.translation, torch.cat((z1, z1.flip(0)), dim=1))
        hidden = dropped(F.leaky_relu(model.decoder.hidden(dropped(z3)), 0.2))

        noise = torch.Generator().manual_seed(1)
        torch.testing.assert_close(model.encode_expert(frames, noise), z1)
        torch.testing.assert_close(model.translate(z1, z1.flip(0), noise=noise), z3)
        decoded = model.decoder(z3, model.decoder.skip_terms(maps), noise)
        torch.testing.assert_close(decoded, convolve_as_stated(model, hidden, maps), rtol=1e-4, atol=1e-5)


def test_without_noise_there_is_no_dropout():
    model = ContextTranslator("real", 48).train()
    frames = torch.rand(4, 3, 48, 48)
    with torch.no_grad():
        assert torch.equal(model.encode_expert(frames), model.encode_expert(frames))


def test_simulation_architectures_have_no_dropout():
    model = ContextTranslator("compact", 16)
    frames = torch.rand(4, 3, 16, 16)
    with torch.no_grad():
        assert torch.equal(model.encode_expert(frames), model.encode_expert(frames, torch.Generator()))


@pytest.mark.parametrize(("architecture", "size"), [("real", 50), ("compact", 40), ("sim", 0), ("tiny", 64)])
def test_impossible_models_are_refused(architecture, size):
    with pytest.raises(AnyviewError, match=architecture):
        make_translator(architecture, size)
