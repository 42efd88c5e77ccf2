"""Enc: the keypoints of a frame and what is seen there, with the losses that teach where they are."""

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from anyview.translator.keypoints.codes import (
    CHANNELS,
    KEYPOINTS,
    LOOK,
    OUTSIDE,
    SIGMA,
    VECTOR,
    axis_of,
    convolution,
    draw_strokes,
    gaussian,
    places_of,
)
from anyview.translator.network import activate

_SHARPNESS = 0.02  # weight of the cross-entropy of maps


class Seen(NamedTuple):
    """What the encoder makes of frames (N, 3, H, W)."""

    code: Tensor
    """(N, 2 K + V + 8 S): x and y of the keypoints, -1 to 1 from edge to edge; a vector; the looks of the
    strokes, which are the keypoints and the lines from each to the next."""
    map: Tensor
    """(N, 16, H/2, W/2)."""
    logits: Tensor
    """Of each keypoint to be at a pixel of that map, row by row, (N, K, H/2 * W/2)."""


class KeypointEncoder(nn.Module):
    """Maps that shrink thrice and grow back twice, so that a place's meaning depends on all of the frame."""

    def __init__(self) -> None:
        super().__init__()
        fine, middle, coarse = CHANNELS
        self.down = nn.ModuleList(
            [convolution(3, fine, 5, 2), convolution(fine, middle, 3, 2), convolution(middle, coarse, 3, 2)]
        )
        self.deep = convolution(coarse, coarse, 3)
        self.everywhere = nn.Linear(coarse, coarse)
        self.lateral = nn.ModuleList([nn.Conv2d(middle, middle, 1), nn.Conv2d(fine, fine, 1)])
        self.up = nn.ModuleList([nn.Conv2d(coarse, middle, 1), nn.Conv2d(middle, fine, 1)])
        self.smooth = nn.ModuleList([convolution(middle, middle, 3), convolution(fine, fine, 3)])
        self.heat = nn.Conv2d(fine, KEYPOINTS, 1)
        self.look = nn.Conv2d(fine, LOOK - 3, 1)
        self.vector = nn.Linear(coarse, VECTOR)

    def forward(self, frames: Tensor) -> Seen:
        x, pooled = self._maps(frames)
        logits, places = self._find(x)
        strokes = draw_strokes(places.detach(), x).flatten(2)
        seen = torch.cat((F.avg_pool2d(frames, 2), self.look(x)), 1)
        looks = F.normalize(strokes, p=1, dim=-1, eps=1.0) @ seen.flatten(2).transpose(1, 2).float()
        return Seen(torch.cat((places.flatten(1), self.vector(pooled), looks.flatten(1)), 1), x, logits)

    def places(self, frames: Tensor) -> Tensor:
        """The places in the code of ``frames`` (N, 3, H, W) by themselves, (N, 2 K): a third faster."""
        return self._find(self._maps(frames)[0])[1].flatten(1)

    def _maps(self, frames: Tensor) -> tuple[Tensor, Tensor]:
        """The finest map (N, 16, H/2, W/2), and the means of the coarsest (N, 64)."""
        fine, middle, coarse = self._shrink(frames)
        x = self.deep(coarse)
        pooled = x.mean((2, 3))
        x = x + self.everywhere(pooled)[:, :, None, None]
        for skip, lateral, up, smooth in zip((middle, fine), self.lateral, self.up, self.smooth, strict=True):
            x = smooth(activate(F.interpolate(up(x), scale_factor=2.0) + lateral(skip)))
        return x, pooled

    def _find(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (N, K, H/2 * W/2) and places (N, K, 2) of the keypoints, of the finest map ``x``."""
        logits = self.heat(x).flatten(2).float()  # places need more digits than bfloat16 has
        where = logits.softmax(-1).unflatten(2, x.shape[2:])
        axis = axis_of(x)
        return logits, torch.stack(((where.sum(2) * axis).sum(-1), (where.sum(3) * axis).sum(-1)), -1)

    def _shrink(self, x: Tensor) -> list[Tensor]:
        maps = []
        for layer in self.down:
            x = layer(x)
            maps.append(x)
        return maps


def place_loss(codes: Tensor, marks: Tensor) -> Tensor:
    """Mean squared distance of the first M keypoints of ``codes`` (N, ...) from ``marks`` (N, M, 2).

    Marks are in the keypoints' units. Those far outside of the picture count as just outside, and those that
    are NaN are not known: no keypoint pays for them.
    """
    gaps = places_of(codes)[:, : marks.shape[1]].float() - marks.clamp(-OUTSIDE, OUTSIDE)
    return torch.where(marks.isnan(), 0.0, gaps).square().sum(-1).mean()


def finding_loss(seen: Seen, marks: Tensor) -> Tensor:
    """``place_loss`` of what is ``seen``, plus ``_SHARPNESS`` times a cross-entropy of the keypoints' maps.

    What these should be are Gaussians around ``marks`` (N, M, 2), those outside of the picture counted as at
    its edge. The mean place alone says little to a map that is wide: half of the updates do (as regularised
    maps do for Nibali et al. 2018).
    """
    maps = seen.logits[:, : marks.shape[1]].log_softmax(-1)
    axis = axis_of(seen.map)
    edge, side = float(axis[-1]), len(axis)
    gaps = axis - marks.nan_to_num(0.0).clamp(-edge, edge)[..., None]  # (N, M, 2, side)
    columns, rows = gaussian((0.5 * side / SIGMA * gaps) ** 2).unbind(2)
    wanted = F.normalize((rows[..., None] * columns[..., None, :]).flatten(2), p=1, dim=-1)
    known = ~marks.isnan().any(-1)
    return place_loss(seen.code, marks) - _SHARPNESS * ((wanted * maps).sum(-1) * known).mean()
