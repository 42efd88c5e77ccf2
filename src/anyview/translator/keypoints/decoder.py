"""Dec: draws keypoints into the first frame of a context."""

from typing import NamedTuple

import torch
from torch import Generator, Tensor, nn
from torch.nn import functional as F

from anyview.translator.keypoints.codes import (
    CHANNELS,
    LOOK,
    STROKES,
    VECTOR,
    convolution,
    draw_strokes,
    grid_of,
    looks_of,
    places_of,
    vector_of,
)
from anyview.translator.network import activate

_COPIED = 5.0  # what the mask of what stands still starts from, so that at first most is copied
_SHIFTING = [0]  # keypoints that carry the first frame along: the object, see video/marks.py
_TURNING = [2, 3]  # those from which lines do: from the tool to the wrist, and on to the elbow
_SHORT = 0.05  # a line shorter than that has no direction


class DrawingTerms(NamedTuple):
    """What a ``KeypointDecoder`` computes once for everything that is decoded in the same contexts."""

    first: Tensor
    """The contexts' first frames, (C, 3, H, W)."""
    still: Tensor
    """The context's part of the finest map, (C, 32, H/2, W/2)."""
    tints: Tensor
    """What a stroke adds to that map where it is drawn, by its look in the first frame, (C, 32, S)."""
    places: Tensor
    """The keypoints of the first frames, (C, K, 2)."""


class KeypointDecoder(nn.Module):
    """Draws the keypoints of codes z (N, 2 K + V + 8 S) into the contexts' first frames: (N, 3, H, W)."""

    def __init__(self) -> None:
        super().__init__()
        fine, middle, coarse = CHANNELS
        self.still = nn.Conv2d(fine, middle, 1)
        self.drawn = nn.Parameter(torch.empty(STROKES, LOOK + 1, middle))
        self.erased = nn.Parameter(torch.empty(STROKES, LOOK + 1, middle))
        self.now = nn.Parameter(torch.empty(STROKES, LOOK, middle))
        for weights in (self.drawn, self.erased, self.now):
            nn.init.normal_(weights, std=(LOOK + 1) ** -0.5)
        self.down = nn.ModuleList([convolution(middle, middle, 3, 2), convolution(middle, coarse, 3, 2)])
        self.vector = nn.Linear(VECTOR, coarse)
        self.deep = convolution(coarse, coarse, 3)
        self.up = nn.ModuleList([_doubling(coarse, middle), _doubling(middle, middle)])
        self.smooth = nn.ModuleList([convolution(middle, middle, 3), convolution(middle, middle, 3)])
        self.last_up = _doubling(middle, fine)
        copies = 1 + len(_SHIFTING) + len(_TURNING)  # of the first frame: where it was, and carried along
        self.layers = copies + 1, STROKES
        self.output = nn.Conv2d(fine + 3 * copies, 3 + sum(self.layers), 3, padding=1)
        with torch.no_grad():
            self.output.bias[3] += _COPIED  # type: ignore[index]

    def skip_terms(self, skips: list[Tensor]) -> DrawingTerms:
        """What ``forward`` needs of what ``KeypointTranslator.encode_context`` returns beside z2."""
        first, code, finest = skips
        looks = looks_of(code)
        known = torch.cat((looks, torch.ones_like(looks[..., :1])), -1)
        drawn, erased = (torch.einsum("nka,kac->nck", known, w) for w in (self.drawn, self.erased))
        still = self.still(finest)
        places = places_of(code)
        return DrawingTerms(first, still + _paint(erased, draw_strokes(places, still)), drawn, places)

    def forward(self, z: Tensor, terms: DrawingTerms, noise: Generator | None = None) -> Tensor:
        """``z`` (N, ...) in the ``terms`` of C contexts, row n modulo C; ``noise`` is not needed."""
        first, still, tints, before = (
            each if len(each) == len(z) else each.repeat(len(z) // len(each), *[1] * (each.ndim - 1))
            for each in terms
        )
        tints = tints + torch.einsum("nka,kac->nck", looks_of(z), self.now)
        finest = activate(still + _paint(tints, draw_strokes(places_of(z), still)))
        middle = self.down[0](finest)
        x = self.down[1](middle)
        x = self.deep(x + self.vector(vector_of(z))[:, :, None, None])
        for skip, up, smooth in zip((middle, finest), self.up, self.smooth, strict=True):
            x = smooth(activate(up(x) + skip))
        copies = torch.cat((first[:, None], _carry(first, before, places_of(z))), 1)
        x = self.output(torch.cat((activate(self.last_up(x)), copies.flatten(1, 2).to(x.dtype)), 1)).float()
        drawn, masks = x.split((3, sum(self.layers)), 1)
        whole, flat = masks.softmax(1).split(self.layers, 1)
        layers = torch.cat((copies, drawn[:, None]), 1)
        colours = looks_of(z)[..., :3].float().transpose(1, 2)
        return (layers * whole[:, :, None]).sum(1) + (colours @ flat.flatten(2)).unflatten(2, first.shape[2:])


def _carry(first: Tensor, before: Tensor, now: Tensor) -> Tensor:
    """First frames (N, 3, H, W) carried by keypoints from ``before`` to ``now`` (N, K, 2): (N, B, 3, H, W).

    A keypoint shifts the picture. A line shifts it as its first end moves, and turns it as it turns itself.
    """
    before, now = before.float(), now.float()
    ends = _SHIFTING + _TURNING
    x, y = (axis - now[:, ends, i, None, None] for i, axis in enumerate(grid_of(first)))  # (N, B, H, W)
    old, new = (
        F.normalize(places[:, 1:] - places[:, :-1], dim=-1, eps=_SHORT)[:, _TURNING]
        for places in (before, now)
    )
    upright = torch.ones_like(before[:, _SHIFTING, 0])
    cosine = torch.cat((upright, (old * new).sum(-1)), 1)[..., None, None]
    sine = torch.cat((0 * upright, old[..., 1] * new[..., 0] - old[..., 0] * new[..., 1]), 1)[..., None, None]
    sources = torch.stack((cosine * x - sine * y, sine * x + cosine * y), -1) + before[:, ends, None, None]
    seen = F.grid_sample(first.float(), sources.flatten(1, 2), padding_mode="border", align_corners=False)
    return seen.unflatten(2, (len(ends), first.shape[2])).transpose(1, 2)


def _paint(tints: Tensor, strokes: Tensor) -> Tensor:
    """(N, C, H, W): the tint of each stroke, of ``tints`` (N, C, S), where that of ``strokes`` is high."""
    return (tints @ strokes.flatten(2)).unflatten(2, strokes.shape[2:])


def _doubling(inputs: int, outputs: int) -> nn.ConvTranspose2d:
    return nn.ConvTranspose2d(inputs, outputs, 4, 2, padding=1)
