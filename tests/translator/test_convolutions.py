"""The decoder's own convolutions against PyTorch's plain one."""

import pytest
import torch
from torch import Tensor
from torch.nn import functional as F

from anyview.translator.convolutions import fractional_convolution


def plain(x: Tensor, weight: Tensor, bias: Tensor | None, stride: int) -> Tensor:
    """The reference."""
    return F.conv_transpose2d(x, weight, bias, stride, padding=2, output_padding=stride - 1)


@pytest.mark.parametrize("stride", [1, 2])
@pytest.mark.parametrize("channels", [3, 16])
@pytest.mark.parametrize("with_bias", [True, False])
@pytest.mark.parametrize("layout", [torch.contiguous_format, torch.channels_last])
def test_it_is_a_transposed_convolution_and_its_gradients(stride, channels, with_bias, layout):
    generator = torch.Generator().manual_seed(stride)

    def draw(*shape: int) -> Tensor:
        return torch.randn(shape, generator=generator, dtype=torch.float64)

    x, weight = draw(4, 6, 5, 7).contiguous(memory_format=layout), draw(6, channels, 5, 5)
    learned = [x, weight, *([draw(channels)] if with_bias else [])]
    for tensor in learned:
        tensor.requires_grad_()
    bias = learned[2] if with_bias else None
    ours, expected = (convolve(x, weight, bias, stride) for convolve in (fractional_convolution, plain))
    assert ours.shape == (4, channels, 5 * stride, 7 * stride)
    torch.testing.assert_close(ours, expected)
    upstream = draw(*ours.shape)
    gradients = [torch.autograd.grad((output * upstream).sum(), learned) for output in (ours, expected)]
    for found, wanted in zip(*gradients, strict=True):
        torch.testing.assert_close(found, wanted, rtol=1e-5, atol=1e-5)  # a bias is summed in float32
