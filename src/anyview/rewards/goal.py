"""XIRL's reward (Zakka et al. 2021): how near an agent's frame is to the demonstrations' last ones."""

import numpy as np
import torch
from torch import Tensor

from anyview.embedding.network import Embedding
from anyview.rewards.fixed import FixedReward
from anyview.video.pixels import to_input


class GoalReward(FixedReward):
    """-|e(o_t) - g| / |e(o_0) - g|, g the mean of e over the last frames; see ``interfaces.RewardSource``.

    Standing still earns -1 a step. ``scales`` are the distances |e(o_0) - g| (R,): reward * scales is in the
    embedding's own scale. Nothing is learned.
    """

    def __init__(self, model: Embedding, demonstrations: np.ndarray, first_frames: np.ndarray):
        """uint8 ``demonstrations`` (m, T + 1, H, W, 3), or (R, m, ...) if each run has its own.

        ``first_frames`` are (R, H, W, 3).
        """
        self._model = model
        self._device = next(model.parameters()).device
        self._goals = self._embed(demonstrations[..., -1, :, :, :]).mean(-2)  # (D,) or (R, D)
        self._costs = (self._embed(first_frames) - self._goals).norm(dim=-1).clamp_min(1e-6)
        self.scales = self._costs.cpu().numpy()

    @torch.inference_mode()
    def _embed(self, frames: np.ndarray) -> Tensor:
        """Embeddings (..., D) of uint8 ``frames`` (..., H, W, 3)."""
        pixels = to_input(torch.from_numpy(np.ascontiguousarray(frames)).to(self._device))
        return self._model(pixels.flatten(0, -4)).unflatten(0, pixels.shape[:-3])

    @torch.inference_mode()
    def step(self, frames: np.ndarray, step: int) -> np.ndarray:
        """Rewards (R, C) of uint8 ``frames`` (R, C, H, W, 3), whichever ``step`` it is."""
        goals = self._goals.expand(len(frames), -1)[:, None]
        away = (self._embed(frames) - goals).norm(dim=-1)
        return (-away / self._costs[:, None]).cpu().numpy()
