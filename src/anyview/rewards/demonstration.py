"""Rewards that compare what an agent's camera sees with a demonstration in its own view (equations 20 to 22).

L_f(o_t) = -|Enc1(o_t) - mean_i T(Enc1(o_t^i), Enc2(o_0^a))|^2 over features, and
L_i(o_t) = -|o_t - mean_i G(o_t^i, o_0^a)|^2 over pixels and colours in [-1, 1], for t = 1..T; the means are
over the m demonstrations i, and o_0^a is the first frame of the agent a. Of codes that are keypoints and
more, only the keypoints' places are compared.
"""

from collections.abc import Callable, Sequence

import numpy as np
import torch
from torch import Tensor

from anyview.config import Incomplete, RewardWeights
from anyview.rewards.fixed import FixedReward
from anyview.translator.architectures import Translator, embed_task
from anyview.video.pixels import to_frames, to_input

_BATCH = 64


class DemonstrationReward(FixedReward):
    """-(t/T)^p (w_f L_f/u_f + w_i L_i/u_i)/(w_f + w_i): see ``interfaces.RewardSource``. Nothing is learned.

    u_f and u_i are a run's own means over t of (t/T)^p |..|^2 for a camera that keeps seeing o_0: the cost of
    standing still. So standing still earns -1 a step in every context and with every translator, one learning
    rate serves them all, and the weights have no unit. A term of weight 0 is not computed.

    With ``raw`` weights it is -(t/T)^p (w_f L_f + w_i L_i)/(w_f u_f + w_i u_i): equation 22 with phi =
    w_i/w_f, up to a constant of the run, so that standing still earns -1 a step here too.

    ``scales`` (R,) bring a reward back to the equations' scale, where L_f has weight 1: reward * scales =
    L_f + phi L_i, or L_i where w_f is 0. Here phi = w_i/w_f, times u_f/u_i unless the weights are ``raw``.
    """

    def __init__(
        self,
        model: Translator,
        features: Tensor,
        images: Tensor,
        first_frames: np.ndarray,
        weights: RewardWeights,
        time_power: float,
        there: np.ndarray | None = None,
    ):
        """Targets ``features`` (R, T, F), ``images`` (R, T, 3, H, W); uint8 ``first_frames`` (R, H, W, 3).

        Where ``there`` (T + 1,) says that the clips have no frame, the reward is 0.
        """
        device = features.device
        self._model, self._features, self._images = model, features, images
        self._first = first_frames
        steps = features.shape[1]
        self._weights = (torch.arange(1, steps + 1, device=device) / steps) ** time_power
        if there is not None:
            self._weights *= torch.from_numpy(there[1:]).to(device)
        first = to_input(torch.from_numpy(first_frames).to(device))
        with torch.inference_mode():
            still_features = ((model.expert_features(first)[:, None] - features) ** 2).sum(-1)
            still_images = ((first[:, None] - images) ** 2).sum((2, 3, 4))
        feature_cost = (self._weights * still_features).mean(1, keepdim=True).clamp_min(1e-6)  # (R, 1)
        image_cost = (self._weights * still_images).mean(1, keepdim=True).clamp_min(1e-6)
        self._feature_scale, self._image_scale, scales = scalings(weights, feature_cost, image_cost)
        self.scales = scales[:, 0].cpu().numpy()

    @torch.inference_mode()
    def step(self, frames: np.ndarray, step: int) -> np.ndarray:
        """Rewards (R, C) of uint8 ``frames`` (R, C, H, W, 3) seen after action ``step`` (1 to T)."""
        seen = to_input(torch.from_numpy(frames).to(self._features.device))
        reward = torch.zeros(seen.shape[:2], device=seen.device)
        if self._feature_scale.any():
            features = self._model.expert_features(seen.flatten(0, 1)).unflatten(0, seen.shape[:2])
            reward -= self._feature_scale * ((features - self._features[:, None, step - 1]) ** 2).sum(-1)
        if self._image_scale.any():
            away = (seen - self._images[:, None, step - 1]).flatten(2)
            reward -= self._image_scale * (away**2).sum(-1)
        return (self._weights[step - 1] * reward).cpu().numpy()

    def targets(self) -> np.ndarray:
        """The demonstration each run imitates, from o_0 on in its own view: uint8 (R, T + 1, H, W, 3)."""
        return np.concatenate([self._first[:, None], to_frames(self._images)], axis=1)


def scalings(
    weights: RewardWeights, feature_cost: Tensor, image_cost: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """What squared distances of features and of images are multiplied by, so that standing still costs 1.

    The costs are those of standing still, any shape. Third, what brings a reward back to the equations'
    scale: see ``DemonstrationReward``.
    """
    feature: float | Tensor = weights.feature
    image: float | Tensor = weights.image
    if weights.raw:
        feature, image = feature * feature_cost, image * image_cost
    norm = feature + image
    leading = feature_cost / feature if weights.feature else image_cost / image
    return feature / norm / feature_cost, image / norm / image_cost, leading * norm


def frames_there(length: int, incomplete: Incomplete) -> np.ndarray:
    """Which of a clip's ``length`` frames there are: (length,) bool. The first always is."""
    steps = np.arange(length)
    return (steps % incomplete.every == 0) & (steps <= incomplete.until * (length - 1))


def hold(clips: np.ndarray, there: np.ndarray) -> np.ndarray:
    """``clips`` (..., T + 1, H, W, 3) where the last frame that is ``there`` (T + 1,) stands for the next."""
    return clips[..., np.maximum.accumulate(np.where(there, np.arange(len(there)), 0)), :, :, :]


@torch.inference_mode()
def translate_demonstrations(
    model: Translator, demonstrations: np.ndarray, first_frames: np.ndarray
) -> tuple[Tensor, Tensor]:
    """Mean translated features (R, T, F) and frames (R, T, 3, H, W) for each agent's first frame.

    ``demonstrations`` (m, T + 1, H, W, 3), or (R, m, ...) if each agent has its own, and ``first_frames``
    (R, H, W, 3) are uint8.
    """
    if demonstrations.ndim == 6:
        own = zip(demonstrations, first_frames, strict=True)
        parts = [translate_demonstrations(model, clips, first[None]) for clips, first in own]
        features, images = zip(*parts, strict=True)
        return torch.cat(features), torch.cat(images)
    device = next(model.parameters()).device
    clips = [_in_parts(model.encode_expert, clip[1:], device) for clip in demonstrations]
    return _translate(model, clips, first_frames, device)


@torch.inference_mode()
def translate_clock(model: Translator, clips: np.ndarray, first_frames: np.ndarray) -> tuple[Tensor, Tensor]:
    """What the translator makes of the mean of Enc1 over ``clips``, which tells it nothing but the time step.

    Shapes as of ``translate_demonstrations``.
    """
    device = next(model.parameters()).device
    mean = torch.stack([_in_parts(model.encode_expert, clip[1:], device) for clip in clips]).mean(0)
    return _translate(model, [mean], first_frames, device)


@torch.inference_mode()
def translate_each(
    model: Translator, demonstrations: np.ndarray, first_frames: np.ndarray
) -> tuple[Tensor, Tensor]:
    """As ``translate_demonstrations``, of every clip: features (R, m, T, F) and frames (R, m, T, 3, H, W)."""
    device = next(model.parameters()).device
    shared = demonstrations.ndim == 5
    encoded = [
        [_in_parts(model.encode_expert, clip[1:], device) for clip in clips]
        for clips in ([demonstrations] if shared else demonstrations)
    ]
    agents = zip(encoded * len(first_frames) if shared else encoded, first_frames, strict=True)
    pairs = [_translations(model, clips, frame, device) for clips, frame in agents]
    features, images = zip(*pairs, strict=True)
    return torch.stack(features), torch.stack(images)


def _translate(
    model: Translator, clips: Sequence[Tensor], first_frames: np.ndarray, device: torch.device
) -> tuple[Tensor, Tensor]:
    """The means over ``clips``, each z1 (T, Z), of their translated features and frames."""
    pairs = [[each.mean(0) for each in _translations(model, clips, frame, device)] for frame in first_frames]
    features, images = zip(*pairs, strict=True)
    return torch.stack(features), torch.stack(images)


def _translations(
    model: Translator, clips: Sequence[Tensor], first_frame: np.ndarray, device: torch.device
) -> tuple[Tensor, Tensor]:
    """Features (m, T, F) and frames (m, T, 3, H, W) of ``clips`` for the agent's ``first_frame``."""
    z2, skips = model.encode_context(to_input(torch.from_numpy(first_frame[None]).to(device)))
    translated = [model.translate(z1, z2, embed_task(model, z1)) for z1 in clips]
    features = torch.stack([model.features(z3) for z3 in translated])
    return features, torch.stack([model.decode(z3, skips) for z3 in translated])


@torch.inference_mode()
def true_demonstrations(model: Translator, clips: np.ndarray) -> tuple[Tensor, Tensor]:
    """The Oracle's targets: Enc1(o_t) and o_t of ``clips`` (R, T + 1, H, W, 3), each in its agent's view."""
    device = next(model.parameters()).device
    features = torch.stack([_in_parts(model.expert_features, clip[1:], device) for clip in clips])
    return features, to_input(torch.from_numpy(clips[:, 1:]).to(device))


def _in_parts(
    encode: Callable[[Tensor], Tensor], frames: Sequence[np.ndarray] | np.ndarray, device: torch.device
) -> Tensor:
    """What ``encode`` makes of uint8 frames (N, H, W, 3), a bounded batch at a time."""
    pixels = torch.from_numpy(np.ascontiguousarray(frames)).to(device)
    return torch.cat([encode(to_input(part)) for part in pixels.split(_BATCH)])
