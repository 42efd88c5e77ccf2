"""The `tcn` baseline's reward: how near an agent's frame is to the demonstrations', in an embedding."""

import numpy as np
import torch
from torch import Tensor

from anyview.embedding.network import Embedding
from anyview.rewards.fixed import FixedReward
from anyview.video.pixels import to_input


class EmbeddingReward(FixedReward):
    """-(t/T)^p |e(o_t) - mean_i e(o_t^i)|^2 / u over demonstrations i; see ``interfaces.RewardSource``.

    By a constant of t it is the mean of -|e(o_t) - e(o_t^i)|^2. As in ``rewards.DemonstrationReward``, u is a
    run's mean over t for a camera that keeps seeing o_0: standing still earns -1 a step. ``scales`` are
    these u (R,): reward * scales is in the embedding's own scale. Nothing is learned.
    """

    def __init__(
        self, model: Embedding, demonstrations: np.ndarray, first_frames: np.ndarray, time_power: float
    ):
        """uint8 ``demonstrations`` (m, T + 1, H, W, 3) in any views, ``first_frames`` (R, H, W, 3)."""
        self._model = model
        self._device = next(model.parameters()).device
        self._targets = torch.stack([self._embed(clip[1:]) for clip in demonstrations]).mean(0)  # (T, D)
        steps = len(self._targets)
        self._weights = (torch.arange(1, steps + 1, device=self._device) / steps) ** time_power
        still = ((self._embed(first_frames)[:, None] - self._targets) ** 2).sum(-1)
        self._costs = (self._weights * still).mean(1).clamp_min(1e-6)
        self.scales = self._costs.cpu().numpy()

    @torch.inference_mode()
    def _embed(self, frames: np.ndarray) -> Tensor:
        """Embeddings (N, D) of uint8 ``frames`` (N, H, W, 3)."""
        return self._model(to_input(torch.from_numpy(np.ascontiguousarray(frames)).to(self._device)))

    @torch.inference_mode()
    def step(self, frames: np.ndarray, step: int) -> np.ndarray:
        """Rewards (R, C) of uint8 ``frames`` (R, C, H, W, 3) seen after action ``step`` (1 to T)."""
        runs, copies = frames.shape[:2]
        seen = self._embed(frames.reshape(runs * copies, *frames.shape[2:])).unflatten(0, (runs, copies))
        away = ((seen - self._targets[step - 1]) ** 2).sum(-1)
        return (-self._weights[step - 1] * away / self._costs[:, None]).cpu().numpy()
