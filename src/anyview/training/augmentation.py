"""Other contexts out of the clips at hand: colours, light, crops, and distractors pasted from other clips.

A change of context is the same in every frame of a clip: o_0^j and o_t^j are altered alike, the expert's clip
i by draws of its own. The thesis trains without this, and fails where there are many distractors (figure 17).
"""

import math

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from anyview.translator.losses import Marks
from anyview.video.datasets import Dataset
from anyview.video.pixels import to_input

_KEPT = 0.2  # fraction of the clips that stay as filmed
_DISTRACTORS = 8  # pasted at most
_TINT = 0.6  # fraction of a colour of its own in each distractor
_RADIUS = (0.04, 0.12)  # of a distractor, in widths of the frame
_MOVING = 40  # a pixel whose grey levels span more in a clip belongs to the motion
_HUE_WIDTH = 4.0  # concentration of the hue that is turned: about 60 degrees of the colour circle
_WHITE, _BRIGHTNESS, _SHADE = (
    0.08,
    0.2,
    0.3,
)  # spreads of white balance, brightness and light across the frame
_ZOOM, _TURN = 1.25, math.radians(8)


class Augmentation:
    """Alters batches of a dataset's training clips.

    Colours: one hue is turned to another, with another saturation and white balance. Light: brightness and a
    gradient across the frame. Distractors: tinted pieces of other clips, where nothing moves in the clip.
    Crop: a zoom with a shift and a small turn.
    """

    def __init__(self, dataset: Dataset):
        training = dataset.split("train")
        first = dataset.frames[training, 0]
        self._donors = to_input(first)
        self._saliency = _saliency(first)
        self._still = torch.ones(len(dataset.frames), 1, *dataset.frames.shape[2:4], dtype=torch.bool)
        for clip in training:
            frames = dataset.frames[clip]
            span = (frames.max(axis=0) - frames.min(axis=0)).max(axis=-1)
            self._still[clip, 0] = torch.from_numpy(span <= _MOVING)

    def __call__(self, frames: Tensor, clips: np.ndarray, rng: np.random.Generator) -> Tensor:
        """Alter ``frames`` (F, N, 3, H, W) in [-1, 1]: the F frames of a clip of ``clips`` alike."""
        altered = self._paste(frames, clips, rng)
        altered = _light(_turn_hue(altered, rng), rng)
        altered = _crop(altered.clamp(-1.0, 1.0), rng)
        kept = torch.from_numpy(rng.random(frames.shape[1]) < _KEPT).to(frames.device)
        return torch.where(kept[:, None, None, None], frames, altered)

    def _paste(self, frames: Tensor, clips: np.ndarray, rng: np.random.Generator) -> Tensor:
        count, size, device = frames.shape[1], frames.shape[-1], frames.device
        still = self._still[torch.from_numpy(clips)].to(device)
        amount = rng.integers(_DISTRACTORS + 1, size=count)
        for index in range(_DISTRACTORS):
            donors = rng.integers(len(self._donors), size=count)
            source = _draw_pixels(self._saliency[donors], rng)
            place = rng.integers(size, size=(2, count))
            radii = rng.uniform(*_RADIUS, size=(2, count)) * size * (index < amount)
            pieces = _shift(self._donors[torch.from_numpy(donors)].to(device), source - place)
            colours = torch.from_numpy(rng.uniform(-1, 1, (count, 3))).to(device, torch.float32)
            pieces = torch.lerp(pieces, colours[:, :, None, None], _TINT)
            inside = _ellipses(place, radii, size).to(device)
            frames = torch.where(inside & still, pieces, frames)
        return frames


def mirror(
    paired: Tensor, context: Tensor, clip: Tensor | None, marks: Marks | None, rng: np.random.Generator
) -> tuple[Tensor, Tensor, Tensor | None, Marks | None]:
    """Half of the experts' clips and half of the contexts mirrored, marks too; see ``batch_losses``."""
    experts, contexts = (
        torch.from_numpy(rng.random(len(context)) < 0.5).to(context.device) for _ in range(2)
    )

    def flip(frames: Tensor, which: Tensor) -> Tensor:
        return torch.where(which.view(-1, *[1] * (frames.ndim - 1)), frames.flip(-1), frames)

    def reflect(places: Tensor, which: Tensor) -> Tensor:
        return torch.where(which[:, None, None], places * places.new_tensor((-1.0, 1.0)), places)

    both = torch.cat((experts, contexts))
    return (
        flip(paired, both),
        flip(context, contexts),
        None if clip is None else flip(clip, experts),
        None if marks is None else Marks(reflect(marks.paired, both), reflect(marks.context, contexts)),
    )


def _shift(pictures: Tensor, offsets: np.ndarray) -> Tensor:
    """Move each picture (N, 3, H, W) up and left by ``offsets`` (2, N), around the edges."""
    axis = torch.arange(pictures.shape[-1], device=pictures.device)
    rows, columns = ((axis + torch.from_numpy(o).to(axis)[:, None]) % len(axis) for o in offsets)
    along = torch.arange(len(pictures), device=pictures.device)[:, None, None]
    return pictures.movedim(1, -1)[along, rows[:, :, None], columns[:, None]].movedim(-1, 1)


def _ellipses(centres: np.ndarray, radii: np.ndarray, size: int) -> Tensor:
    """(N, 1, size, size): which pixels lie in the ellipses of ``centres`` (2, N) and ``radii`` (2, N)."""
    y, x = (np.arange(size) - centres[..., None]) / np.maximum(radii[..., None], 1e-6)
    return torch.from_numpy(y[:, None, :, None] ** 2 + x[:, None, None, :] ** 2 < 1)


def _saliency(frames: np.ndarray) -> np.ndarray:
    """(N, H W) cumulative probabilities of pixels: those far from the frame's median colour are likely."""
    difference = np.abs(frames - np.median(frames, axis=(1, 2), keepdims=True)).sum(axis=-1)
    weights = difference.reshape(len(frames), -1) ** 2 + 1.0
    return np.cumsum(weights, axis=1) / weights.sum(axis=1, keepdims=True)


def _draw_pixels(cumulative: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(2, N) row and column of one pixel drawn from each row of ``cumulative``."""
    flat = (cumulative < rng.random((len(cumulative), 1))).sum(axis=1)
    size = math.isqrt(cumulative.shape[1])
    return np.stack((flat // size, flat % size))


def _numbers(values: np.ndarray, like: Tensor) -> Tensor:
    """One number for each clip, to broadcast over (F, N, H, W)."""
    return torch.from_numpy(values).to(like.device, torch.float32)[:, None, None]


def _turn_hue(frames: Tensor, rng: np.random.Generator) -> Tensor:
    """Turn one random hue of each clip by a random angle, hues near it by less, and scale the saturation."""
    count = frames.shape[1]
    centre = _numbers(rng.uniform(-math.pi, math.pi, count), frames)
    angle = _numbers(rng.uniform(-math.pi, math.pi, count), frames)
    saturation = _numbers(rng.uniform(0.6, 1.4, count), frames)
    red, green, blue = frames.unbind(2)
    grey = (red + green + blue) / 3
    u, v = (2 * red - green - blue) / math.sqrt(6), (green - blue) / math.sqrt(2)
    hue = torch.atan2(v, u)
    turned = hue + angle * torch.exp(_HUE_WIDTH * (torch.cos(hue - centre) - 1))
    chroma = torch.hypot(u, v) * saturation
    u, v = chroma * torch.cos(turned) / math.sqrt(6), chroma * torch.sin(turned) / math.sqrt(2)
    return torch.stack((grey + 2 * u, grey - u + v, grey - u - v), dim=2)


def _light(frames: Tensor, rng: np.random.Generator) -> Tensor:
    """Another white balance and brightness, and light that falls off across the frame."""
    count, size = frames.shape[1], frames.shape[-1]
    gains = np.exp(rng.normal(0, _WHITE, (count, 3)) + rng.normal(0, _BRIGHTNESS, (count, 1)))
    gain = torch.from_numpy(gains).to(frames.device, torch.float32)[:, :, None, None]
    across, down = (_numbers(rng.uniform(-_SHADE, _SHADE, count), frames) for _ in range(2))
    axis = torch.linspace(-1, 1, size, device=frames.device)
    shade = 1 + across * axis + down * axis[:, None]
    return (frames + 1) * gain * shade[:, None] - 1


def _crop(frames: Tensor, rng: np.random.Generator) -> Tensor:
    """Zoom in, shift within what the zoom leaves out, and turn the frame a little."""
    count = frames.shape[1]
    scale = 1 / rng.uniform(1, _ZOOM, count)
    turn = rng.uniform(-_TURN, _TURN, count)
    shift = rng.uniform(-1, 1, (2, count)) * (1 - scale)
    affine = np.empty((count, 2, 3))
    affine[:, 0] = np.stack((scale * np.cos(turn), -scale * np.sin(turn), shift[0]), axis=1)
    affine[:, 1] = np.stack((scale * np.sin(turn), scale * np.cos(turn), shift[1]), axis=1)
    matrix = torch.from_numpy(affine).to(frames.device, torch.float32)
    grid = F.affine_grid(matrix, list(frames.shape[1:]), align_corners=False)
    return torch.stack(
        [F.grid_sample(frame, grid, padding_mode="border", align_corners=False) for frame in frames]
    )
