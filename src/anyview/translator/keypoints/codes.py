"""The code of a translator of keypoints: its layout, and what both encoder and decoder make of its places."""

import torch
from torch import Tensor, nn
from torch.nn import functional as F

KEYPOINTS = 8
STROKES = 2 * KEYPOINTS - 1  # the keypoints, and the lines from each to the next
VECTOR = 32  # entries of a code beside the places, for what these do not say
LOOK = 8  # entries that describe what is seen at a stroke, of which the first three are its colour
WIDTH = 2 * KEYPOINTS + VECTOR + STROKES * LOOK
CHANNELS = 16, 32, 64  # of the maps at a half, a quarter and an eighth of the frame's side
SIGMA = 1.0  # of a Gaussian, in pixels of the finest map
OUTSIDE = 1.1  # where what is outside of the picture counts as being


def places_of(code: Tensor) -> Tensor:
    """(N, K, 2) of codes (N, 2 K + V + 8 S)."""
    return code[:, : 2 * KEYPOINTS].unflatten(1, (KEYPOINTS, 2))


def vector_of(code: Tensor) -> Tensor:
    """(N, V) of codes (N, 2 K + V + 8 S)."""
    return code[:, 2 * KEYPOINTS : 2 * KEYPOINTS + VECTOR]


def looks_of(code: Tensor) -> Tensor:
    """(N, S, 8) of codes (N, 2 K + V + 8 S)."""
    return code[:, 2 * KEYPOINTS + VECTOR :].unflatten(1, (STROKES, LOOK))


def with_places(codes: Tensor, marks: Tensor) -> Tensor:
    """``codes`` (N, ...) with their first M keypoints at ``marks`` (N, M, 2), where these are known."""
    known = marks.clamp(-OUTSIDE, OUTSIDE).flatten(1).to(codes.dtype)
    found, others = codes.split((known.shape[1], codes.shape[1] - known.shape[1]), 1)
    return torch.cat((torch.where(known.isnan(), found, known), others), 1)


def axis_of(like: Tensor) -> Tensor:
    """The centres of the columns, or of the rows, of square maps ``like``, -1 to 1 from edge to edge."""
    side = like.shape[-1]
    return (2 * torch.arange(side, device=like.device, dtype=torch.float32) + 1) / side - 1


def grid_of(like: Tensor) -> tuple[Tensor, Tensor]:
    """x and y (H, W) of the pixels of square maps ``like``."""
    axis = axis_of(like)
    x, y = torch.meshgrid(axis, axis, indexing="xy")
    return x, y


def draw_strokes(places: Tensor, like: Tensor) -> Tensor:
    """(N, 2 K - 1, H, W), on maps ``like``: Gaussians of height 1 around ``places`` (N, K, 2) and lines.

    There is a line from each keypoint to the next.
    """
    with torch.autocast(like.device.type, enabled=False):  # differences of squares need all digits
        squares = _squares(places.float(), torch.stack(grid_of(like)).flatten(1))
    return gaussian((0.5 * like.shape[-1] / SIGMA) ** 2 * squares).unflatten(2, like.shape[2:])


def gaussian(squares: Tensor) -> Tensor:
    """exp(-x^2/2) of x^2, no smaller than 1e-35: below that processors count ten times as slowly."""
    return torch.exp((-0.5 * squares).clamp_min(-80.0))


def _squares(places: Tensor, grid: Tensor) -> Tensor:
    """Squared distances (N, 2 K - 1, P) of ``grid`` (2, P) from ``places`` (N, K, 2), then from the lines."""
    # |p - a|^2 of every pixel p and place a, and of lines from a along w what is nearest, t w beyond a.
    squares = grid.square().sum(0) - 2 * places @ grid + places.square().sum(-1, keepdim=True)
    start, ways = places[:, :-1], places[:, 1:] - places[:, :-1]
    along = ways @ grid - (ways * start).sum(-1, keepdim=True)  # (p - a) w
    length = ways.square().sum(-1, keepdim=True)
    t = (along / length.clamp(min=1e-6)).clamp(0, 1)
    return torch.cat((squares, squares[:, :-1] - t * (2 * along - t * length)), 1)


class _GroupNorm(nn.GroupNorm):
    """In float32, whatever it is given: in bfloat16 and channels_last PyTorch's takes six times as long."""

    def forward(self, input: Tensor) -> Tensor:
        weight, bias = self.weight.float(), self.bias.float()
        return F.group_norm(input.float(), self.num_groups, weight, bias, self.eps).to(input.dtype)


def convolution(inputs: int, outputs: int, kernel: int, stride: int = 1) -> nn.Sequential:
    """A convolution, normalised in groups of 8 channels (Wu and He 2018): half of the updates do."""
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, kernel, stride, padding=kernel // 2),
        _GroupNorm(outputs // 8, outputs),
        nn.LeakyReLU(0.2, inplace=True),
    )
