"""The translator's losses, on the thesis's scale.

Its loss values fit L_tr and L_rec as half the sum of squares over a batch of 100 frames, and L_align as 1,000
times the mean (inferred: the thesis does not say). So the scale stays the same for any batch size here.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import torch
from torch import Generator, Tensor
from torch.nn import functional as F

from anyview.config import LossWeights
from anyview.translator.architectures import Translator
from anyview.translator.keypoints.codes import with_places
from anyview.translator.keypoints.encoder import finding_loss, place_loss
from anyview.translator.keypoints.translator import KeypointTranslator

FRAME_SCALE = 100 / 2
ALIGNMENT_SCALE = 1000
PLACE_SCALE = (
    50_000  # ours: an object a pixel of 48 away from its place costs 87, and one beside the picture most
)

NAMES = ("translation", "reconstruction", "alignment")


class Marks(NamedTuple):
    """Where M things are in the frames of a batch, x and y from -1 to 1 in a picture; NaN if not known."""

    paired: Tensor
    """(2N, M, 2)."""
    context: Tensor
    """(N, M, 2)."""


@dataclass(frozen=True)
class Losses:
    """L_tr, L_rec and L_align of a batch, scalars; None where a loss was left out.

    ``places`` is ours, and there for keypoints and clips with marks.
    """

    translation: Tensor | None
    reconstruction: Tensor | None
    alignment: Tensor | None
    places: Tensor | None = None

    def total(self, weights: LossWeights) -> Tensor:
        """L = w_tr L_tr + w_rec L_rec + w_align L_align + w_places L_places of the losses that are there."""
        names = (*NAMES, "places")
        parts = [getattr(weights, name) * loss for name in names if (loss := getattr(self, name)) is not None]
        return sum(parts[1:], parts[0])

    def parts(self) -> list[Tensor]:
        """The three losses without gradients, NaN where one was left out."""
        present = [getattr(self, name) for name in NAMES]
        like = next(loss for loss in present if loss is not None)
        return [torch.full_like(like, torch.nan) if loss is None else loss.detach() for loss in present]


def frame_loss(output: Tensor, target: Tensor) -> Tensor:
    """50 |output - target|^2, mean over the batch; both (N, 3, H, W) in [-1, 1]."""
    return torch.as_tensor(_SquaredError.apply(output, target)) * (FRAME_SCALE / len(target))


class _SquaredError(torch.autograd.Function):
    """The sum of squares of output - target; backward scales the difference that forward left.

    PyTorch's own subtracts twice and fills a gradient of the pictures' size with zeros first.
    """

    @staticmethod
    def forward(ctx: Any, output: Tensor, target: Tensor) -> Tensor:
        ctx.difference, ctx.dtype = output.to(torch.float32, copy=True).sub_(target), output.dtype
        return ctx.difference.square().sum()

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None]:
        return ctx.difference.mul_(2 * gradient).to(ctx.dtype), None


def alignment_loss(z3: Tensor, z_true: Tensor) -> Tensor:
    """1,000 times the mean square of z3 - Enc1(o_t^j); both (N, width)."""
    return F.mse_loss(z3.float(), z_true.float()) * ALIGNMENT_SCALE


def batch_losses(
    model: Translator,
    paired: Tensor,
    context: Tensor,
    clip: Tensor | None = None,
    wanted: LossWeights | None = None,
    noise: Generator | None = None,
    marks: Marks | None = None,
) -> Losses:
    """Losses of ``paired`` (2N, 3, H, W), o_t^i and after them o_t^j, and ``context`` o_0^j (N, 3, H, W).

    Frames are in [-1, 1]. ``clip`` (N, K, 3, H, W) are ``task_frames`` of the expert's clips, if T is given a
    task embedding. With ``wanted`` only the losses whose weight is above 0 are computed; ``noise``
    turns dropout on. With ``marks`` there is L_places, of a translator of keypoints, and L_tr is of what it
    draws at the places that are marked. What the decoder makes of the skips is computed once for both
    decodings, and these are one batch.
    """
    target = paired[len(context) :]
    found = None
    if marks is not None and isinstance(model, KeypointTranslator):
        seen, first = model.encoder(paired), model.encoder(context)
        found = (2 * finding_loss(seen, marks.paired) + finding_loss(first, marks.context)) / 3
        z, (z2, skips) = seen.code, model.context_of(context, first)
    else:
        z = model.encode_expert(paired, noise)
        z2, skips = model.encode_context(context, noise)
    z1, z_true = z.chunk(2)
    task = None
    if clip is not None:
        # Without gradients a batch takes a quarter longer than with no embedding, and not twice as long. Enc1
        # learns from the frames of the pair what tells one end of the task from another.
        with torch.no_grad():
            codes = model.encode_expert(clip.flatten(0, 1)).unflatten(0, clip.shape[:2])
            task = model.summarise(codes)
    z3 = model.translate(z1, z2, task, noise)
    skip_terms = model.decoder.skip_terms(skips)

    places, drawn = None, z3
    if found is not None and marks is not None:
        wanted_places = marks.paired[len(context) :]
        places = PLACE_SCALE * (found + place_loss(z3, wanted_places))
        # Dec learns to draw from the places that are right. Those found at first teach it to blur.
        drawn = with_places(z3, wanted_places)

    translated = drawn if wanted is None or wanted.translation else None
    reconstructed = z_true if wanted is None or wanted.reconstruction else None
    of_frames = _frame_losses(model, (translated, reconstructed), skip_terms, target, noise)
    return Losses(
        *of_frames,
        alignment_loss(z3, z_true) if wanted is None or wanted.alignment else None,
        places if wanted is not None and wanted.places else None,
    )


def _frame_losses(
    model: Translator,
    codes: tuple[Tensor | None, Tensor | None],
    skip_terms: Any,
    target: Tensor,
    noise: Generator | None,
) -> tuple[Tensor | None, Tensor | None]:
    """``frame_loss`` of what each of two ``codes`` (N, ...) is decoded to, at once; None for None."""
    given = [z for z in codes if z is not None]
    if not given:
        return None, None
    decoded = iter(model.decoder(torch.cat(given), skip_terms, noise).chunk(len(given)))
    first, second = (None if z is None else frame_loss(next(decoded), target) for z in codes)
    return first, second
