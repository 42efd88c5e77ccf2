"""The context translator: two encoders, the translation module and the decoder with skips.

Enc1(o_t^i) -> z1 reads the expert's frame, Enc2(o_0^j) -> z2 the first frame of the target context,
T(z1, z2) -> z3, and Dec(z3, skips of Enc2(o_0^j)) is the expert's frame as the target context would show it.

Where the same start can lead to several ends, an early frame does not tell which. There T can be given a task
embedding of the whole clip as well (after James et al. 2018): the mean of Enc1 over some of its frames.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, NamedTuple, cast

import numpy as np
import torch
from torch import Generator, Tensor, nn
from torch.nn import functional as F

from anyview.runtime.errors import AnyviewError
from anyview.translator.convolutions import KERNEL, fractional_convolution

ArchitectureName = Literal["real", "sim", "compact"]

_LEAK = 0.2
_COLOURS = 3
_TASK_FRAMES = 8


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


class Encoder(nn.Module):
    """Four convolutions and two connected layers: (N, 3, H, W) -> z (N, width) and the four maps."""

    def __init__(self, architecture: Architecture, image_size: int):
        super().__init__()
        channels = [_COLOURS, *(count for count, _ in architecture.encoder)]
        self.convolutions = nn.ModuleList(
            nn.Conv2d(before, after, KERNEL, stride, padding=KERNEL // 2)
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
            x = activate(convolution(x))
            maps.append(x)
        flat = x.movedim(1, -1).flatten(1)  # (row, column, channel): no copy in channels_last
        hidden = activate(self.hidden(_drop(flat, self._dropout, noise)))
        return self.output(_drop(hidden, self._dropout, noise)), maps


class Translation(nn.Module):
    """T: the concatenated features, two or three of (N, width) -> z3 (N, width)."""

    def __init__(self, architecture: Architecture, inputs: int):
        super().__init__()
        self.hidden = nn.Linear(inputs * architecture.width, architecture.width)
        self.output = nn.Linear(architecture.width, architecture.width)
        self._dropout = architecture.dropout

    def forward(self, features: list[Tensor], noise: Generator | None = None) -> Tensor:
        joined = torch.cat(features, dim=1)
        hidden = activate(self.hidden(_drop(joined, self._dropout, noise)))
        return self.output(_drop(hidden, self._dropout, noise))


class SkipTerms(NamedTuple):
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
        super().__init__(below + skip, channels, KERNEL, stride, KERNEL // 2, output_padding=stride - 1)
        self._parts = [below, skip]

    def skip_terms(self, skip: Tensor) -> SkipTerms:
        """What ``forward`` needs besides the layer below, of Enc2's map ``skip`` (K, ...)."""
        weight, skip_weight = self.weight.split(self._parts)
        return SkipTerms(weight, self._convolve(skip, skip_weight, self.bias))

    def forward(self, x: Tensor, terms: SkipTerms) -> Tensor:  # type: ignore[override]
        """The layer's output for ``x`` (N, ...) and the ``terms`` of K contexts, row n modulo K."""
        own = self._convolve(x, terms.weight, None)
        if len(own) == len(terms.map):
            return own.add_(terms.map)
        return (own.unflatten(0, (-1, len(terms.map))) + terms.map).flatten(0, 1)

    def _convolve(self, x: Tensor, weight: Tensor, bias: Tensor | None) -> Tensor:
        return fractional_convolution(x, weight.to(x.dtype), bias, self.stride[0])


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

    def skip_terms(self, skips: list[Tensor]) -> list[SkipTerms]:
        """What each convolution needs of Enc2's maps, for ``forward``."""
        layers = cast(Iterable[SkipConvolution], self.convolutions)
        return [layer.skip_terms(skip) for layer, skip in zip(layers, reversed(skips), strict=True)]

    def forward(self, z: Tensor, skip_terms: list[SkipTerms], noise: Generator | None = None) -> Tensor:
        hidden = activate(self.hidden(_drop(z, self._dropout, noise)))
        hidden = _drop(hidden, self._dropout, noise)
        x = hidden.unflatten(1, (self._side, self._side, -1)).movedim(-1, 1)
        *layers, last = zip(self.convolutions, skip_terms, strict=True)
        for convolution, terms in layers:
            x = activate(convolution(x, terms))
        convolution, terms = last
        return convolution(x, terms)


def activate(x: Tensor) -> Tensor:
    return F.leaky_relu(x, _LEAK, inplace=True)


def _drop(x: Tensor, probability: float, noise: Generator | None) -> Tensor:
    """Dropout, in training alone: where there is ``noise`` to draw the mask from."""
    if noise is None or probability == 0:
        return x
    keep = 1 - probability
    return x * torch.empty_like(x).bernoulli_(keep, generator=noise).div_(keep)


class ContextTranslator(nn.Module):
    """The whole translator for square frames of ``image_size`` pixels; ``task_embedding``: T is given one.

    Dropout, where the architecture has any, is on where a method is given the generator ``noise`` to draw its
    masks from, and off otherwise, whatever mode the module is in.
    Raises ``AnyviewError`` for a size that its strides do not divide.
    """

    def __init__(self, architecture: ArchitectureName, image_size: int, task_embedding: bool = False):
        super().__init__()
        layers = ARCHITECTURES[architecture]
        if image_size < layers.stride or image_size % layers.stride:
            raise AnyviewError(
                f"architecture {architecture}: image size {image_size} must be a multiple of {layers.stride}"
            )
        self.architecture = architecture
        self.image_size = image_size
        self.task_embedding = task_embedding
        self.width = layers.width
        self.expert_encoder = Encoder(layers, image_size)
        # In `real` both encoders are one module: its weights are shared, and stored once.
        self.context_encoder = self.expert_encoder if layers.shared else Encoder(layers, image_size)
        self.translation = Translation(layers, 3 if task_embedding else 2)
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

    def task_frames(self, length: int) -> np.ndarray:
        """Steps of a clip of ``length`` frames that its task embedding is the mean of; none if there is none.

        They are the middles of equal parts.
        """
        count = _TASK_FRAMES if self.task_embedding else 0
        return ((np.arange(count) + 0.5) * length / max(count, 1)).astype(int)

    def summarise(self, codes: Tensor) -> Tensor:
        """The task embedding (N, width) of clips, of the codes (N, K, width) of their ``task_frames``."""
        return codes.mean(1)

    def translate(
        self, z1: Tensor, z2: Tensor, task: Tensor | None = None, noise: Generator | None = None
    ) -> Tensor:
        """T: z3 (N, width) of z1 (N, width), z2 and the ``task`` embedding, each (N, width) or (1, width)."""
        features = [z1, z2] if task is None else [z1, z2, task]
        return self.translation([each.expand_as(z1) for each in features], noise)

    def features(self, z: Tensor) -> Tensor:
        """What of z (N, width) a reward compares: all of it."""
        return z

    def expert_features(self, frames: Tensor) -> Tensor:
        """``features`` of the z1 of ``frames`` (N, 3, H, W)."""
        return self.encode_expert(frames)

    def decode(self, z: Tensor, skips: list[Tensor]) -> Tensor:
        """Dec: frames (N, 3, H, W) of z (N, width) and the skips of K contexts, where K divides N.

        Row n is decoded in context n modulo K: one context serves a whole clip, for example.
        """
        return self.decoder(z, self.decoder.skip_terms(skips))
