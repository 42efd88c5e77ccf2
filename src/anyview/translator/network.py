"""The context translator: two encoders, the translation module and the decoder with skips.

Enc1(o_t^i) -> z1 reads the expert's frame, Enc2(o_0^j) -> z2 the first frame of the target context,
T(z1, z2) -> z3, and Dec(z3, skips of Enc2(o_0^j)) is the expert's frame as the target context would show it.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, cast

import numpy as np
import torch
from torch import Generator, Tensor, nn
from torch.nn import functional as F

from anyview.runtime.errors import AnyviewError

ArchitectureName = Literal["real", "sim", "compact"]

_KERNEL = 5
_LEAK = 0.2
_COLOURS = 3


@dataclass(frozen=True)
class Architecture:
    """Layers of one translator, each convolution as (output channels, stride)."""

    encoder: tuple[tuple[int, int], ...]
    decoder: tuple[tuple[int, int], ...]
    width: int
    shared: bool
    dropout: float

    @property
    def stride(self) -> int:
        """Input pixels to a pixel of the last convolution's map."""
        return int(np.prod([stride for _, stride in self.encoder]))


ARCHITECTURES: dict[ArchitectureName, Architecture] = {
    "real": Architecture(
        encoder=((32, 1), (16, 2), (16, 1), (8, 2)),
        decoder=((16, 2), (16, 1), (32, 2), (_COLOURS, 1)),
        width=100,
        shared=True,
        dropout=0.5,
    ),
    "sim": Architecture(
        encoder=((64, 2), (128, 2), (256, 2), (512, 2)),
        decoder=((256, 2), (128, 2), (64, 2), (_COLOURS, 2)),
        width=1024,
        shared=False,
        dropout=0.0,
    ),
    "compact": Architecture(
        encoder=((16, 2), (32, 2), (64, 2), (128, 2)),
        decoder=((64, 2), (32, 2), (16, 2), (_COLOURS, 2)),
        width=256,
        shared=False,
        dropout=0.0,
    ),
}


def to_input(frames: np.ndarray | Tensor) -> Tensor:
    """Network input (..., 3, H, W) in [-1, 1], float32, of uint8 ``frames`` (..., H, W, 3)."""
    pixels = frames if isinstance(frames, Tensor) else torch.tensor(frames)
    return pixels.movedim(-1, -3).to(torch.float32).div_(127.5).sub_(1.0)


def to_frames(output: Tensor) -> np.ndarray:
    """uint8 frames (..., H, W, 3) of network output (..., 3, H, W)."""
    pixels = output.detach().float().add(1.0).mul(127.5).round_().clamp_(0.0, 255.0)
    return pixels.to(torch.uint8).movedim(-3, -1).cpu().numpy()


class Encoder(nn.Module):
    """Four convolutions and two connected layers: (N, 3, H, W) -> z (N, width) and the four maps."""

    def __init__(self, architecture: Architecture, image_size: int):
        super().__init__()
        channels = [_COLOURS, *(count for count, _ in architecture.encoder)]
        self.convolutions = nn.ModuleList(
            nn.Conv2d(before, after, _KERNEL, stride, padding=_KERNEL // 2)
            for before, (after, stride) in zip(channels, architecture.encoder, strict=False)
        )
        side = image_size // architecture.stride
        self.hidden = nn.Linear(side * side * channels[-1], architecture.width)
        self.output = nn.Linear(architecture.width, architecture.width)
        self._dropout = architecture.dropout

    def forward(self, frames: Tensor, noise: Generator | None = None) -> tuple[Tensor, list[Tensor]]:
        maps = []
        x = frames
        for convolution in self.convolutions:
            x = _activate(convolution(x))
            maps.append(x)
        flat = x.movedim(1, -1).flatten(1)  # (row, column, channel): no copy in channels_last
        return self.output(_drop(_activate(self.hidden(flat)), self._dropout, noise)), maps


class Translation(nn.Module):
    """T: the concatenated features (N, width) of both encoders -> z3 (N, width)."""

    def __init__(self, architecture: Architecture):
        super().__init__()
        self.hidden = nn.Linear(2 * architecture.width, architecture.width)
        self.output = nn.Linear(architecture.width, architecture.width)
        self._dropout = architecture.dropout

    def forward(self, z1: Tensor, z2: Tensor, noise: Generator | None = None) -> Tensor:
        hidden = _activate(self.hidden(torch.cat((z1, z2), dim=1)))
        return self.output(_drop(hidden, self._dropout, noise))


class Share(NamedTuple):
    """What a ``SkipConvolution`` computes once for everything that is decoded in the same K contexts."""

    weight: Tensor
    """The weights of the layer below."""
    map: Tensor
    """The part of Enc2's map, the bias with it, (K, channels, H, W)."""


class SkipConvolution(nn.ConvTranspose2d):
    """Fractional convolution over the concatenation of the layer below and Enc2's map of equal size.

    It is linear, so the two parts are convolved apart and added.
    """

    def __init__(self, below: int, skip: int, channels: int, stride: int):
        super().__init__(below + skip, channels, _KERNEL, stride, _KERNEL // 2, output_padding=stride - 1)
        self._parts = [below, skip]

    def share(self, skip: Tensor) -> Share:
        """What ``forward`` needs besides the layer below, of Enc2's map ``skip`` (K, ...)."""
        weight, skip_weight = self.weight.split(self._parts)
        return Share(weight, self._convolve(skip, skip_weight, self.bias))

    def forward(self, x: Tensor, share: Share) -> Tensor:  # type: ignore[override]
        """The layer's output for ``x`` (N, ...) and the ``share`` of K contexts, row n modulo K."""
        own = self._convolve(x, share.weight, None)
        known = share.map
        if len(known) != len(own):
            known = known.repeat(len(own) // len(known), 1, 1, 1)
        return own.add_(known)

    def _convolve(self, x: Tensor, weight: Tensor, bias: Tensor | None) -> Tensor:
        return cast(Tensor, _FractionalConvolution.apply(x, weight.to(x.dtype), bias, self.stride[0]))


class _FractionalConvolution(torch.autograd.Function):
    """PyTorch's ``conv_transpose2d``, x (N, K, H, W) -> (N, C, sH, sW), where that is slow on a processor.

    Forward is where it ends in the few colours, backward where there is a bias.
    """

    @staticmethod
    def forward(ctx: Any, x: Tensor, weight: Tensor, bias: Tensor | None, stride: int) -> Tensor:
        ctx.save_for_backward(x, weight)
        ctx.stride = stride
        if stride == 2 and weight.shape[1] == _COLOURS:
            return _double_to_colours(x, weight, bias)
        return F.conv_transpose2d(x, weight, bias, stride, _KERNEL // 2, stride - 1)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:
        x, weight = ctx.saved_tensors
        of_x, of_weight, of_bias, _ = ctx.needs_input_grad
        stride, half, one = [ctx.stride] * 2, [_KERNEL // 2] * 2, [1, 1]
        output_padding, wanted = [ctx.stride - 1] * 2, [of_x, of_weight, False]
        x_gradient, weight_gradient, _ = torch.ops.aten.convolution_backward(
            gradient, x, weight, None, stride, half, one, True, output_padding, 1, wanted
        )
        return x_gradient, weight_gradient, _sum_over_places(gradient) if of_bias else None, None


def _double_to_colours(x: Tensor, weight: Tensor, bias: Tensor | None) -> Tensor:
    """The fractional convolution of stride 2 that ends in colours, x (N, K, H, W) -> (N, 3, 2H, 2W).

    Its even and odd rows and columns are four plain 3x3 convolutions of ``x``: done as one, they take less
    than half the time.
    """
    inputs, outputs = weight.shape[:2]
    # Output 2y + a takes input y + d by the weight at k = a + 2 - 2d: of six places, counted from the
    # last, the one at 2(d + 1) + 1 - a.
    taps = F.pad(weight, (0, 1, 0, 1)).flip(2, 3).view(inputs, outputs, 3, 2, 3, 2).flip(3, 5)
    kernel = taps.permute(3, 5, 1, 0, 2, 4).reshape(4 * outputs, inputs, 3, 3)
    parts = F.conv2d(x, kernel, None if bias is None else bias.repeat(4), padding=1)
    # Colours come last in memory, two columns' beside each other: only rows and columns change places.
    places = parts.movedim(1, -1).unflatten(-1, (2, -1)).transpose(2, 3)
    shape = len(x), outputs, 2 * x.shape[2], 2 * x.shape[3]
    output = torch.empty(shape, dtype=x.dtype, device=x.device, memory_format=torch.channels_last)
    output.movedim(1, -1).view_as(places).copy_(places)
    return output


def _sum_over_places(gradient: Tensor) -> Tensor:
    """A bias's gradient (C,) of the ``gradient`` (N, C, H, W) of what it was added to."""
    if gradient.device.type != "cpu":
        return gradient.sum((0, 2, 3))
    # Place after place of a picture, then picture after picture, in float32: PyTorch's own order, so the same
    # bits. But a bag of embeddings does all channels at once, in a twentieth of the time.
    places = gradient.movedim(1, -1).flatten(0, 2).float()
    pictures = F.embedding_bag(torch.arange(len(places)).view(len(gradient), -1), places, mode="sum")
    return F.embedding_bag(torch.arange(len(pictures))[None], pictures, mode="sum")[0].to(gradient.dtype)


class Decoder(nn.Module):
    """A connected layer and four fractional convolutions with skips: z (N, width) -> (N, 3, H, W)."""

    def __init__(self, architecture: Architecture, image_size: int):
        super().__init__()
        self._side = image_size // architecture.stride
        skips = [count for count, _ in reversed(architecture.encoder)]
        inputs = [skips[0], *(count for count, _ in architecture.decoder)]
        self.hidden = nn.Linear(architecture.width, self._side**2 * skips[0])
        self._dropout = architecture.dropout
        self.convolutions = nn.ModuleList(
            SkipConvolution(below, skip, channels, stride)
            for below, skip, (channels, stride) in zip(inputs, skips, architecture.decoder, strict=False)
        )

    def shares(self, skips: list[Tensor]) -> list[Share]:
        """What each convolution needs of Enc2's maps, for ``forward``."""
        layers = cast(Iterable[SkipConvolution], self.convolutions)
        return [layer.share(skip) for layer, skip in zip(layers, reversed(skips), strict=True)]

    def forward(self, z: Tensor, shares: list[Share], noise: Generator | None = None) -> Tensor:
        hidden = _drop(_activate(self.hidden(z)), self._dropout, noise)
        x = hidden.unflatten(1, (self._side, self._side, -1)).movedim(-1, 1)
        *layers, last = zip(self.convolutions, shares, strict=True)
        for convolution, share in layers:
            x = _activate(convolution(x, share))
        convolution, share = last
        return convolution(x, share)


def _activate(x: Tensor) -> Tensor:
    return F.leaky_relu(x, _LEAK, inplace=True)


def _drop(x: Tensor, probability: float, noise: Generator | None) -> Tensor:
    """Dropout, in training alone: where there is ``noise`` to draw the mask from."""
    if noise is None or probability == 0:
        return x
    keep = 1 - probability
    return x * torch.empty_like(x).bernoulli_(keep, generator=noise).div_(keep)


class ContextTranslator(nn.Module):
    """The whole translator for square frames of ``image_size`` pixels.

    Dropout, where the architecture has any, is on where a method is given the generator ``noise`` to draw its
    masks from, and off otherwise, whatever mode the module is in.
    Raises ``AnyviewError`` for an unknown architecture or a size that its strides do not divide.
    """

    def __init__(self, architecture: ArchitectureName, image_size: int):
        super().__init__()
        if architecture not in ARCHITECTURES:
            raise AnyviewError(f"architecture {architecture!r}: must be one of {', '.join(ARCHITECTURES)}")
        layers = ARCHITECTURES[architecture]
        if image_size < layers.stride or image_size % layers.stride:
            raise AnyviewError(
                f"architecture {architecture}: image size {image_size} must be a multiple of {layers.stride}"
            )
        self.architecture = architecture
        self.image_size = image_size
        self.width = layers.width
        self.expert_encoder = Encoder(layers, image_size)
        # In `real` both encoders are one module: its weights are shared, and stored once.
        self.context_encoder = self.expert_encoder if layers.shared else Encoder(layers, image_size)
        self.translation = Translation(layers)
        self.decoder = Decoder(layers, image_size)

    @property
    def shared(self) -> bool:
        """Whether Enc1 and Enc2 are one encoder."""
        return self.context_encoder is self.expert_encoder

    def encode_expert(self, frames: Tensor, noise: Generator | None = None) -> Tensor:
        """Enc1: z1 (N, width) of ``frames`` (N, 3, H, W) in [-1, 1]."""
        return self.expert_encoder(frames, noise)[0]

    def encode_context(self, frames: Tensor, noise: Generator | None = None) -> tuple[Tensor, list[Tensor]]:
        """Enc2: z2 (N, width) of first frames (N, 3, H, W), and the four maps that the decoder skips to."""
        return self.context_encoder(frames, noise)

    def translate(self, z1: Tensor, z2: Tensor, noise: Generator | None = None) -> Tensor:
        """T: z3 (N, width) of z1 (N, width) and z2 (N, width)."""
        return self.translation(z1, z2, noise)

    def decode(self, z: Tensor, skips: list[Tensor]) -> Tensor:
        """Dec: frames (N, 3, H, W) of z (N, width) and the skips of K contexts, where K divides N.

        Row n is decoded in context n modulo K: one context serves a whole clip, for example.
        """
        return self.decoder(z, self.decoder.shares(skips))
