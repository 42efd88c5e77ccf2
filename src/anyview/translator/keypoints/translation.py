"""T: where the keypoints of a context's first frame go."""

import torch
from torch import Tensor, nn

from anyview.translator.keypoints.codes import KEYPOINTS, places_of
from anyview.translator.network import activate

_HIDDEN = 256
_NEAR = 0.15  # of where something ends
_LEAST_WAY = 0.1  # between two keypoints, so that the same place twice is no division by nothing


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
        places = places_of(z2)
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


def relative_places(codes: Tensor, first: Tensor, ends: Tensor | None = None) -> Tensor:
    """Places (N, 2 K) of ``codes`` along and beside the way from the first to the second of ``first``'s.

    With ``ends`` (N, 1, K) it leads to a mean of ``first``'s places, of these weights. In units of that way:
    the same for all points of view from above, and for all sizes. Those more than three ways off count as
    that far.
    """
    places = places_of(first)
    start = places[:, :1]  # (N, 1, 2)
    end = places[:, 1:2] if ends is None else ends @ places
    way, offsets = end - start, places_of(codes) - start
    square = way.square().sum(-1).clamp_min(_LEAST_WAY**2)
    along = (offsets * way).sum(-1) / square
    beside = (way[..., 0] * offsets[..., 1] - way[..., 1] * offsets[..., 0]) / square
    return torch.stack((along, beside), -1).flatten(1).clamp(-3, 3)


def _ends(first: Tensor, last: Tensor, bias: Tensor) -> Tensor:
    """How near each keypoint of ``first`` is to where the first one of ``last`` is: weights (N, 1, K)."""
    squares = (places_of(first) - places_of(last)[:, :1]).square().sum(-1)
    return (bias - squares / (2 * _NEAR**2)).softmax(-1)[:, None]
