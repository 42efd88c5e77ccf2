"""A translator whose code is a list of places: where things are, not what the whole picture is like.

Enc finds keypoints: the mean places under softmaxes over maps (Finn et al. 2016), with what is seen there and
along the lines from each to the next. T tells from the expert's keypoints, now and in the first frame, where
those of the target's first frame go, and takes from the expert what an arm looks like. Dec draws that in
layers that masks blend (Ebert et al. 2017): the target's first frame, so that whatever stands still is
copied; the same carried along by the object, the tool and the forearm (Siarohin et al. 2019), so that these
stay as sharp as they were; the colour of each keypoint and line; for the rest what a network draws from
Gaussians at the keypoints (Jakab et al. 2018, Kulkarni et al. 2019) and along the lines.

Same methods as those of ``network.ContextTranslator``, with one encoder for the expert and for the context.
"""

from typing import NamedTuple

import numpy as np
import torch
from torch import Generator, Tensor, nn
from torch.nn import functional as F

from anyview.runtime.errors import AnyviewError
from anyview.translator.network import activate

KEYPOINTS = 8
_STROKES = 2 * KEYPOINTS - 1  # the keypoints, and the lines from each to the next
_VECTOR = 32  # entries of a code beside the places, for what these do not say
_LOOK = 8  # entries that describe what is seen at a stroke, of which the first three are its colour
_CHANNELS = 16, 32, 64  # of the maps at a half, a quarter and an eighth of the frame's side
_HIDDEN = 256
_STRIDE = 8
_NEAR = 0.15  # of where something ends
_OUTSIDE = 1.1  # where what is outside of the picture counts as being
_LEAST_WAY = 0.1  # between two keypoints, so that the same place twice is no division by nothing
_COPIED = 5.0  # what the mask of what stands still starts from, so that at first most is copied
_SHIFTING = [0]  # keypoints that carry the first frame along: the object, see video/marks.py
_TURNING = [2, 3]  # those from which lines do: from the tool to the wrist, and on to the elbow
_SHORT = 0.05  # a line shorter than that has no direction
_SIGMA = 1.0  # of a Gaussian, in pixels of the finest map
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
        fine, middle, coarse = _CHANNELS
        self.down = nn.ModuleList(
            [_layer(3, fine, 5, 2), _layer(fine, middle, 3, 2), _layer(middle, coarse, 3, 2)]
        )
        self.deep = _layer(coarse, coarse, 3)
        self.everywhere = nn.Linear(coarse, coarse)
        self.lateral = nn.ModuleList([nn.Conv2d(middle, middle, 1), nn.Conv2d(fine, fine, 1)])
        self.up = nn.ModuleList([nn.Conv2d(coarse, middle, 1), nn.Conv2d(middle, fine, 1)])
        self.smooth = nn.ModuleList([_layer(middle, middle, 3), _layer(fine, fine, 3)])
        self.heat = nn.Conv2d(fine, KEYPOINTS, 1)
        self.look = nn.Conv2d(fine, _LOOK - 3, 1)
        self.vector = nn.Linear(coarse, _VECTOR)

    def forward(self, frames: Tensor) -> Seen:
        fine, middle, coarse = self._shrink(frames)
        x = self.deep(coarse)
        pooled = x.mean((2, 3))
        x = x + self.everywhere(pooled)[:, :, None, None]
        for skip, lateral, up, smooth in zip((middle, fine), self.lateral, self.up, self.smooth, strict=True):
            x = smooth(activate(F.interpolate(up(x), scale_factor=2.0) + lateral(skip)))
        logits = self.heat(x).flatten(2).float()  # places need more digits than bfloat16 has
        where = logits.softmax(-1).unflatten(2, x.shape[2:])
        axis = _axis(x)
        places = torch.stack(((where.sum(2) * axis).sum(-1), (where.sum(3) * axis).sum(-1)), -1)
        strokes = _strokes(places.detach(), x).flatten(2)
        seen = torch.cat((F.avg_pool2d(frames, 2), self.look(x)), 1)
        looks = F.normalize(strokes, p=1, dim=-1, eps=1.0) @ seen.flatten(2).transpose(1, 2).float()
        return Seen(torch.cat((places.flatten(1), self.vector(pooled), looks.flatten(1)), 1), x, logits)

    def _shrink(self, x: Tensor) -> list[Tensor]:
        maps = []
        for layer in self.down:
            x = layer(x)
            maps.append(x)
        return maps


class KeypointTranslation(nn.Module):
    """T: where the keypoints of a target's first frame go, as the expert's first and present frames tell.

    Each goes to a weighted sum of all their places, and a step beside it. So "half of the way from the object
    to the target" is one set of weights for all contexts and points of view.

    If ``relative``, T is also told where the keypoints are on the way from the first to the second in the
    first frames: "half of the way" is a quotient of distances, which layers learn slowly. And looks start
    from the context's own: that is for experts of another body.

    If it is told the ``end``, the expert's last frame, that way leads not to the second keypoint but to the
    one where the first ends: a mean of those that are near (an attention, Vaswani et al. 2017). And keypoints
    may go there as well.
    """

    def __init__(self, width: int, relative: bool = False, end: bool = False):
        super().__init__()
        self.relative = relative
        inputs = 3 * (width + 2 * KEYPOINTS * relative)
        self.hidden = nn.ModuleList([nn.Linear(inputs, _HIDDEN), nn.Linear(_HIDDEN, _HIDDEN)])
        self.weights = nn.Linear(_HIDDEN, KEYPOINTS * (KEYPOINTS + end))
        self.steps = nn.Linear(_HIDDEN, width)
        with torch.no_grad():  # at first all stay where they are
            for layer in (self.weights, self.steps):
                layer.weight.mul_(0.1)
                layer.bias.zero_()
        self.ends = nn.Parameter(torch.zeros(KEYPOINTS)) if end else None

    def forward(self, z1: Tensor, z2: Tensor, first: Tensor, last: Tensor | None = None) -> Tensor:
        """z3 (N, width) of ``z1``, ``z2`` and the expert's ``first`` and ``last`` code, each (N, width)."""
        places = _places(z2)
        x, known, ends = torch.cat((z1, z2, first), dim=1), places, None
        if self.ends is not None:
            assert last is not None
            ends = _ends(first, last, self.ends)
            known = torch.cat((places, ends @ places), 1)
        if self.relative:
            on_way = [relative_places(*pair, ends) for pair in ((z1, first), (first, first), (z2, z2))]
            x = torch.cat((x, *on_way), dim=1)
        for layer in self.hidden:
            x = activate(layer(x))
        moved = places + self.weights(x).unflatten(1, (KEYPOINTS, -1)) @ known
        rest = (z2 if self.relative else z1)[:, 2 * KEYPOINTS :]
        return self.steps(x) + torch.cat((moved.flatten(1), rest), 1)


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
        fine, middle, coarse = _CHANNELS
        self.still = nn.Conv2d(fine, middle, 1)
        self.drawn = nn.Parameter(torch.empty(_STROKES, _LOOK + 1, middle))
        self.erased = nn.Parameter(torch.empty(_STROKES, _LOOK + 1, middle))
        self.now = nn.Parameter(torch.empty(_STROKES, _LOOK, middle))
        for weights in (self.drawn, self.erased, self.now):
            nn.init.normal_(weights, std=(_LOOK + 1) ** -0.5)
        self.down = nn.ModuleList([_layer(middle, middle, 3, 2), _layer(middle, coarse, 3, 2)])
        self.vector = nn.Linear(_VECTOR, coarse)
        self.deep = _layer(coarse, coarse, 3)
        self.up = nn.ModuleList([_doubling(coarse, middle), _doubling(middle, middle)])
        self.smooth = nn.ModuleList([_layer(middle, middle, 3), _layer(middle, middle, 3)])
        self.last_up = _doubling(middle, fine)
        copies = 1 + len(_SHIFTING) + len(_TURNING)  # of the first frame: where it was, and carried along
        self.layers = copies + 1, _STROKES
        self.output = nn.Conv2d(fine + 3 * copies, 3 + sum(self.layers), 3, padding=1)
        with torch.no_grad():
            self.output.bias[3] += _COPIED  # type: ignore[index]

    def skip_terms(self, skips: list[Tensor]) -> DrawingTerms:
        """What ``forward`` needs of what ``KeypointTranslator.encode_context`` returns beside z2."""
        first, code, finest = skips
        looks = _looks(code)
        known = torch.cat((looks, torch.ones_like(looks[..., :1])), -1)
        drawn, erased = (torch.einsum("nka,kac->nck", known, w) for w in (self.drawn, self.erased))
        still = self.still(finest)
        places = _places(code)
        return DrawingTerms(first, still + _paint(erased, _strokes(places, still)), drawn, places)

    def forward(self, z: Tensor, terms: DrawingTerms, noise: Generator | None = None) -> Tensor:
        """``z`` (N, ...) in the ``terms`` of C contexts, row n modulo C; ``noise`` is not needed."""
        first, still, tints, before = (
            each if len(each) == len(z) else each.repeat(len(z) // len(each), *[1] * (each.ndim - 1))
            for each in terms
        )
        tints = tints + torch.einsum("nka,kac->nck", _looks(z), self.now)
        finest = activate(still + _paint(tints, _strokes(_places(z), still)))
        middle = self.down[0](finest)
        x = self.down[1](middle)
        x = self.deep(x + self.vector(_vector(z))[:, :, None, None])
        for skip, up, smooth in zip((middle, finest), self.up, self.smooth, strict=True):
            x = smooth(activate(up(x) + skip))
        copies = torch.cat((first[:, None], _carry(first, before, _places(z))), 1)
        x = self.output(torch.cat((activate(self.last_up(x)), copies.flatten(1, 2).to(x.dtype)), 1)).float()
        drawn, masks = x.split((3, sum(self.layers)), 1)
        whole, flat = masks.softmax(1).split(self.layers, 1)
        layers = torch.cat((copies, drawn[:, None]), 1)
        colours = _looks(z)[..., :3].float().transpose(1, 2)
        return (layers * whole[:, :, None]).sum(1) + (colours @ flat.flatten(2)).unflatten(2, first.shape[2:])


class KeypointTranslator(nn.Module):
    """The whole translator for square frames of ``image_size`` pixels.

    Raises ``AnyviewError`` for a size that is no multiple of 8.
    """

    architecture = "keypoint"
    relative = False
    width = 2 * KEYPOINTS + _VECTOR + _STROKES * _LOOK
    shared = True

    def __init__(self, image_size: int, task_embedding: bool = False):
        super().__init__()
        if image_size < _STRIDE or image_size % _STRIDE:
            raise AnyviewError(
                f"architecture {self.architecture}: image size {image_size} must be a multiple of {_STRIDE}"
            )
        self.image_size = image_size
        self.task_embedding = task_embedding
        self.encoder = KeypointEncoder()
        self.translation = KeypointTranslation(self.width, self.relative, task_embedding)
        self.decoder = KeypointDecoder()

    def encode_expert(self, frames: Tensor, noise: Generator | None = None) -> Tensor:
        """z1 (N, width) of ``frames`` (N, 3, H, W) in [-1, 1]."""
        return self.encoder(frames).code

    def encode_context(self, frames: Tensor, noise: Generator | None = None) -> tuple[Tensor, list[Tensor]]:
        """z2 (N, width) of first frames (N, 3, H, W), and what the decoder needs beside codes."""
        return self.context_of(frames, self.encoder(frames))

    def context_of(self, frames: Tensor, seen: Seen) -> tuple[Tensor, list[Tensor]]:
        """What ``encode_context`` returns, of first frames (N, 3, H, W) and of what is ``seen`` in them."""
        return seen.code, [frames, seen.code, seen.map]

    def task_frames(self, length: int) -> np.ndarray:
        """Steps of a clip of ``length`` frames whose codes T is given beside the present one.

        The first; and with a task embedding the last, which tells where the task ends.
        """
        return np.array([0, length - 1] if self.task_embedding else [0])

    def summarise(self, codes: Tensor) -> Tensor:
        """What T is told of a clip, (N, F width), of the codes (N, F, width) of its ``task_frames``."""
        return codes.flatten(1)

    def embed_task(self, z1: Tensor) -> Tensor:
        """What T is told of a clip, (1, F width), of the codes z1 (T, width) of all its frames."""
        return self.summarise(z1[self.task_frames(len(z1))][None])

    def translate(
        self, z1: Tensor, z2: Tensor, task: Tensor | None = None, noise: Generator | None = None
    ) -> Tensor:
        """T: z3 (N, width) of z1 (N, width), z2 (N or 1, width) and ``task``, what it is told of the clip."""
        assert task is not None
        told = [each.expand_as(z1) for each in task.split(self.width, dim=1)]
        return self.translation(z1, z2.expand_as(z1), *told)

    def features(self, z: Tensor) -> Tensor:
        """What of z (N, width) a reward compares: the places, (N, 2 K).

        How an arm looks where it is seen differs more from frame to frame than what a task is about.
        """
        return z[:, : 2 * KEYPOINTS]

    def decode(self, z: Tensor, skips: list[Tensor]) -> Tensor:
        """Dec: frames (N, 3, H, W) of z (N, width) and skips of C contexts, row n in context n modulo C."""
        return self.decoder(z, self.decoder.skip_terms(skips))


class RelativeKeypointTranslator(KeypointTranslator):
    """The same, whose T is told relative places: its first two keypoints must be taught what they are."""

    architecture = "keypoint-relative"
    relative = True


def relative_places(codes: Tensor, first: Tensor, ends: Tensor | None = None) -> Tensor:
    """Places (N, 2 K) of ``codes`` along and beside the way from the first to the second of ``first``'s.

    With ``ends`` (N, 1, K) it leads to a mean of ``first``'s places, of these weights. In units of that way:
    the same for all points of view from above, and for all sizes. Those more than three ways off count as
    that far.
    """
    places = _places(first)
    start = places[:, :1]  # (N, 1, 2)
    end = places[:, 1:2] if ends is None else ends @ places
    way, offsets = end - start, _places(codes) - start
    square = way.square().sum(-1).clamp_min(_LEAST_WAY**2)
    along = (offsets * way).sum(-1) / square
    beside = (way[..., 0] * offsets[..., 1] - way[..., 1] * offsets[..., 0]) / square
    return torch.stack((along, beside), -1).flatten(1).clamp(-3, 3)


def place_loss(codes: Tensor, marks: Tensor) -> Tensor:
    """Mean squared distance of the first M keypoints of ``codes`` (N, ...) from ``marks`` (N, M, 2).

    Marks are in the keypoints' units. Those far outside of the picture count as just outside, and those that
    are NaN are not known: no keypoint pays for them.
    """
    gaps = _places(codes)[:, : marks.shape[1]].float() - marks.clamp(-_OUTSIDE, _OUTSIDE)
    return torch.where(marks.isnan(), 0.0, gaps).square().sum(-1).mean()


def finding_loss(seen: Seen, marks: Tensor) -> Tensor:
    """``place_loss`` of what is ``seen``, plus ``_SHARPNESS`` times a cross-entropy of the keypoints' maps.

    What these should be are Gaussians around ``marks`` (N, M, 2), those outside of the picture counted as at
    its edge. The mean place alone says little to a map that is wide: half of the updates do (as regularised
    maps do for Nibali et al. 2018).
    """
    maps = seen.logits[:, : marks.shape[1]].log_softmax(-1)
    axis = _axis(seen.map)
    edge, side = float(axis[-1]), len(axis)
    gaps = axis - marks.nan_to_num(0.0).clamp(-edge, edge)[..., None]  # (N, M, 2, side)
    columns, rows = _gaussian((0.5 * side / _SIGMA * gaps) ** 2).unbind(2)
    wanted = F.normalize((rows[..., None] * columns[..., None, :]).flatten(2), p=1, dim=-1)
    known = ~marks.isnan().any(-1)
    return place_loss(seen.code, marks) - _SHARPNESS * ((wanted * maps).sum(-1) * known).mean()


def with_places(codes: Tensor, marks: Tensor) -> Tensor:
    """``codes`` (N, ...) with their first M keypoints at ``marks`` (N, M, 2), where these are known."""
    known = marks.clamp(-_OUTSIDE, _OUTSIDE).flatten(1).to(codes.dtype)
    found, others = codes.split((known.shape[1], codes.shape[1] - known.shape[1]), 1)
    return torch.cat((torch.where(known.isnan(), found, known), others), 1)


def _layer(inputs: int, outputs: int, kernel: int, stride: int = 1) -> nn.Sequential:
    """A convolution, normalised in groups of 8 channels (Wu and He 2018): half of the updates do."""
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, kernel, stride, padding=kernel // 2),
        nn.GroupNorm(outputs // 8, outputs),
        nn.LeakyReLU(0.2, inplace=True),
    )


def _doubling(inputs: int, outputs: int) -> nn.ConvTranspose2d:
    return nn.ConvTranspose2d(inputs, outputs, 4, 2, padding=1)


def _ends(first: Tensor, last: Tensor, bias: Tensor) -> Tensor:
    """How near each keypoint of ``first`` is to where the first one of ``last`` is: weights (N, 1, K)."""
    squares = (_places(first) - _places(last)[:, :1]).square().sum(-1)
    return (bias - squares / (2 * _NEAR**2)).softmax(-1)[:, None]


def _places(code: Tensor) -> Tensor:
    """(N, K, 2) of codes (N, 2 K + V + 8 S)."""
    return code[:, : 2 * KEYPOINTS].unflatten(1, (KEYPOINTS, 2))


def _vector(code: Tensor) -> Tensor:
    """(N, V) of codes (N, 2 K + V + 8 S)."""
    return code[:, 2 * KEYPOINTS : 2 * KEYPOINTS + _VECTOR]


def _looks(code: Tensor) -> Tensor:
    """(N, S, 8) of codes (N, 2 K + V + 8 S)."""
    return code[:, 2 * KEYPOINTS + _VECTOR :].unflatten(1, (_STROKES, _LOOK))


def _axis(like: Tensor) -> Tensor:
    """The centres of the columns, or of the rows, of square maps ``like``, -1 to 1 from edge to edge."""
    side = like.shape[-1]
    return (2 * torch.arange(side, device=like.device, dtype=torch.float32) + 1) / side - 1


def _grid(like: Tensor) -> tuple[Tensor, Tensor]:
    """x and y (H, W) of the pixels of square maps ``like``."""
    axis = _axis(like)
    x, y = torch.meshgrid(axis, axis, indexing="xy")
    return x, y


def _strokes(places: Tensor, like: Tensor) -> Tensor:
    """(N, 2 K - 1, H, W), on maps ``like``: Gaussians of height 1 around ``places`` (N, K, 2) and lines.

    There is a line from each keypoint to the next.
    """
    with torch.autocast(like.device.type, enabled=False):  # differences of squares need all digits
        squares = _squares(places.float(), torch.stack(_grid(like)).flatten(1))
    return _gaussian((0.5 * like.shape[-1] / _SIGMA) ** 2 * squares).unflatten(2, like.shape[2:])


def _gaussian(squares: Tensor) -> Tensor:
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


def _carry(first: Tensor, before: Tensor, now: Tensor) -> Tensor:
    """First frames (N, 3, H, W) carried by keypoints from ``before`` to ``now`` (N, K, 2): (N, B, 3, H, W).

    A keypoint shifts the picture. A line shifts it as its first end moves, and turns it as it turns itself.
    """
    before, now = before.float(), now.float()
    ends = _SHIFTING + _TURNING
    x, y = (axis - now[:, ends, i, None, None] for i, axis in enumerate(_grid(first)))  # (N, B, H, W)
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
