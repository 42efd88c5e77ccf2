"""A reward that compares whole episodes with whole clips, whatever the tempo of either, by optimal transport.

After ROT (Haldar et al. 2022): a frame of an episode is as far from a clip as it costs to move it by the plan
that moves all frames of the episode onto all of the clip's at the least cost.
"""

import numpy as np
import torch
from torch import Tensor

from anyview.config import RewardWeights
from anyview.learners.common.interfaces import Arrays
from anyview.rewards.demonstration import scalings
from anyview.translator.architectures import Translator
from anyview.video.pixels import to_frames, to_input

_ENTROPY = 0.05  # in units of what standing still costs
_ROUNDS, _FACTORS = 10, 9  # rounds, and iterations by factors in each
_LEAST = 1e-30  # mass: no factor is infinite


class TransportReward:
    """r_t = -T sum_j P_tj C_tj, the mean over m clips; see ``interfaces.RewardSource``. Nothing is learned.

    C_tj is what ``DemonstrationReward`` charges for seeing frame t where the clip has frame j: (w_f |f_t -
    f_j|^2/u_f + w_i |o_t - o_j|^2/u_i)/(w_f + w_i), with u_f and u_i a run's means for a camera that keeps
    seeing o_0. So standing still earns -1 a step. P is ``transport_plan``'s.

    An episode has its rewards when it has ended: the last step earns their sum, and ``rescored`` has them.
    ``scales`` (R,) are as there.
    """

    def __init__(
        self,
        model: Translator,
        features: Tensor,
        images: Tensor,
        first_frames: np.ndarray,
        weights: RewardWeights,
    ):
        """Targets ``features`` (R, m, T, F), ``images`` (R, m, T, 3, H, W); ``first_frames`` (R, H, W, 3)."""
        self._model, self._first = model, first_frames
        self._shown = images[:, 0]
        self._targets = features, images.flatten(3)
        first = to_input(torch.from_numpy(first_frames).to(features.device))
        with torch.inference_mode():
            still = model.expert_features(first), first.flatten(1)
            costs = [
                (one[:, None, None] - target).square().sum(-1).mean((1, 2)).clamp_min(1e-6)
                for one, target in zip(still, self._targets, strict=True)
            ]
        *factors, scales = scalings(weights, *costs)
        self._factors = [factor[:, None, None, None, None] for factor in factors]
        self.scales = scales.cpu().numpy()
        self._seen: list[tuple[Tensor, Tensor]] = []
        self._ended: np.ndarray | None = None
        self._episodes: list[np.ndarray] = []

    @torch.inference_mode()
    def step(self, frames: np.ndarray, step: int) -> np.ndarray:
        """Rewards (R, C) of uint8 ``frames`` (R, C, H, W, 3) seen after action ``step`` (1 to T)."""
        device, steps = self._shown.device, self._shown.shape[1]
        seen = to_input(torch.from_numpy(frames).to(device))
        if step == 1:
            self._seen = []
        features = self._model.expert_features(seen.flatten(0, 1)).unflatten(0, seen.shape[:2])
        self._seen.append((features, seen.flatten(2)))
        if step < steps:
            return np.zeros(seen.shape[:2], np.float32)
        self._ended = self._rewards().cpu().numpy()
        return self._ended.sum(-1)

    def _rewards(self) -> Tensor:
        """Of the episodes that were seen, (R, C, T)."""
        terms = zip(zip(*self._seen, strict=True), self._targets, self._factors, strict=True)
        cost = torch.stack(
            [
                factor * squared_distances(torch.stack(seen, dim=2), targets)
                for seen, targets, factor in terms
                if factor.any()
            ]
        ).sum(0)
        paid = (transport_plan(cost, _ENTROPY, _ROUNDS) * cost).sum(-1)
        return -paid.mean(2) * cost.shape[-2]

    def end_iteration(self) -> Arrays:
        """Keep what the iteration's episodes earned."""
        assert self._ended is not None
        self._episodes.append(self._ended)
        return {}

    def rescored(self) -> np.ndarray:
        """Rewards (R, E, T) of all episodes so far."""
        return np.concatenate(self._episodes, axis=1)

    def state(self) -> Arrays:
        """What episodes have earned."""
        return {"episodes": self.rescored()} if self._episodes else {}

    def restore(self, state: Arrays) -> None:
        """Continue from ``state()`` bit for bit."""
        self._episodes = [state["episodes"]] if state else []

    def targets(self) -> np.ndarray:
        """The first clip that each run imitates, in its own view: uint8 (R, T + 1, H, W, 3)."""
        return np.concatenate([self._first[:, None], to_frames(self._shown)], axis=1)


def squared_distances(episodes: Tensor, clips: Tensor) -> Tensor:
    """|e_t - c_j|^2 of vectors (R, C, T, F) and (R, m, J, F), of each episode and clip: (R, C, m, T, J)."""
    # One product a run: pictures are too many numbers to be spread over all pairs.
    products = (episodes.flatten(1, 2) @ clips.flatten(1, 2).mT).unflatten(1, episodes.shape[1:3])
    products = products.unflatten(3, clips.shape[1:3]).transpose(2, 3)
    squares = episodes.square().sum(-1)[:, :, None, :, None] + clips.square().sum(-1)[:, None, :, None, :]
    return (squares - 2 * products).clamp_min(0.0)


def transport_plan(cost: Tensor, entropy: float, rounds: int) -> Tensor:
    """The plan (..., T, J) that moves mass 1/T of each row to mass 1/J of each column at ``cost``, as large.

    It minimises its cost minus ``entropy`` times its entropy, by Sinkhorn's iterations (Cuturi 2013). The
    first of each of ``rounds``, one at least, is of logarithms, which bear any cost; the others are factors
    to what it gave, two products each and so several times as fast. The rows' sums are met exactly.
    """
    rows, columns = cost.shape[-2:]
    scaled = -cost / entropy
    of_rows = torch.zeros_like(cost[..., :1])
    for _ in range(rounds):
        of_columns = -np.log(columns) - torch.logsumexp(scaled + of_rows, dim=-2, keepdim=True)
        of_rows = -np.log(rows) - torch.logsumexp(scaled + of_columns, dim=-1, keepdim=True)
        plan = (scaled + of_rows + of_columns).exp()
        column_factors, row_factors = torch.ones_like(of_columns), torch.ones_like(of_rows)
        for _ in range(_FACTORS):
            column_factors = 1 / columns / (row_factors.mT @ plan).clamp_min(_LEAST)
            row_factors = 1 / rows / (plan @ column_factors.mT).clamp_min(_LEAST)
        of_rows = of_rows + row_factors.log()
    return row_factors * plan * column_factors
