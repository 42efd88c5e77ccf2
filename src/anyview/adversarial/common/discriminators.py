"""Rewards learned from video alone: one discriminator a run tells the expert's frames from the agent's.

What GAIL and TPIL share: memory of the agent's episodes, batches, training side by side, checkpoints.
Shapes: R runs, C copies of a run's context, T actions an episode, B a batch; frames are uint8 RGB (H, W, 3).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from anyview import config
from anyview.learners.common.interfaces import Arrays
from anyview.seeds import stream, torch_seed
from anyview.video.pixels import to_input


@dataclass(frozen=True)
class Views:
    """A batch: ``now`` o_t and ``before`` o_max(t - lag, 1), (B, 3, H, W) in [-1, 1]; ``time`` t/T (B,)."""

    before: Tensor
    now: Tensor
    time: Tensor


@dataclass(frozen=True)
class ClipSet:
    """The clips ``rows`` of ``frames`` (N, T + 1, H, W, 3), an array or a memory map."""

    frames: np.ndarray
    rows: np.ndarray

    def draw(self, rng: np.random.Generator, count: int, lag: int) -> Views:
        """``count`` views of random clips at random times 1 to T."""
        clips, last = rng.choice(self.rows, count), self.frames.shape[1] - 1
        return self.views(clips, rng.integers(1, last + 1, size=count), lag)

    def views(self, clips: np.ndarray, times: np.ndarray, lag: int) -> Views:
        """The views of ``clips`` (B,) at ``times`` (B,)."""
        now = to_input(self.frames[clips, times])
        before = to_input(self.frames[clips, np.maximum(times - lag, 1)]) if lag else now
        return Views(before, now, torch.from_numpy(times / (self.frames.shape[1] - 1)).float())


class Discriminator(nn.Module):
    """One run's network. Batches come by the name of their set: "expert", "agent" and what else it needs.

    ``features`` (B, ...) are of single frames, so that what many views share is seen once.
    """

    lag = 0
    features: Callable[[Tensor], Tensor]

    def score(self, before: Tensor, now: Tensor, time: Tensor) -> Tensor:
        """log P(expert)/P(not expert), (B,), by features of both frames of a view: the reward."""
        raise NotImplementedError

    def logits(self, views: Views) -> Tensor:
        """The ``score`` of ``views``, (B,)."""
        now = self.features(views.now)
        return self.score(self.features(views.before) if self.lag else now, now, views.time)

    def score_clip(self, frames: np.ndarray) -> Tensor:
        """The ``score`` of every step of a clip ``frames`` (T + 1, H, W, 3), (T,)."""
        now = self.features(to_input(frames[1:]))
        steps = torch.arange(len(now))
        return self.score(now[(steps - self.lag).clamp(min=0)], now, (steps + 1) / len(now))

    def loss(self, views: Mapping[str, Views]) -> Tensor:
        """What training minimises, a scalar."""
        raise NotImplementedError

    def accuracies(self, views: Mapping[str, Views]) -> dict[str, Tensor]:
        """Fractions told right, by name."""
        expected = {name: name == "expert" for name in views}
        return {
            f"{name}_accuracy": ((self.logits(batch) > 0) == expected[name]).float().mean()
            for name, batch in views.items()
        }


class Halve(nn.Module):
    """Frames (B, C, H, W) at half their size: AvgPool2d takes six times as long where colours are last."""

    def forward(self, frames: Tensor) -> Tensor:
        rows = frames[..., ::2, :] + frames[..., 1::2, :]
        return (rows[..., ::2] + rows[..., 1::2]) / 4


def _every(frames: np.ndarray) -> ClipSet:
    """All clips of ``frames`` (N, T + 1, H, W, 3)."""
    return ClipSet(frames, np.arange(len(frames)))


def cross_entropy(logits: Tensor, label: float) -> Tensor:
    """Mean binary cross-entropy of ``logits`` (B,) that should all say ``label`` (0 or 1)."""
    return F.binary_cross_entropy_with_logits(logits, torch.full_like(logits, label))


def shifted(views: Views, most: int, rng: np.random.Generator) -> Views:
    """``views`` by up to ``most`` pixels each way, a view's frames alike, borders repeated.

    After Kostrikov et al. (2021). Where few frames are known, a network that saw each of them in one place
    alone learns it by heart.
    """
    if not most:
        return views
    frames = F.pad(torch.cat([views.before, views.now], 1), [most] * 4, mode="replicate")
    height, width = views.now.shape[2:]
    places = rng.integers(0, 2 * most + 1, (len(frames), 2))
    cut = [frame[:, y : y + height, x : x + width] for frame, (y, x) in zip(frames, places, strict=True)]
    before, now = torch.stack(cut).chunk(2, 1)
    return Views(before, now, views.time)


def gradient_penalty(network: Discriminator, batches: Sequence[Views]) -> Tensor:
    """Mean of |d logits / d frames|^2 over ``batches``, a scalar.

    For the expert's and the agent's it is the sum of R1 and R2 of Mescheder et al. (2018) for gamma 1.
    Without it logits jump wherever two frames differ, and the reward does not say by how much they do.
    """
    before = torch.cat([views.before for views in batches]).requires_grad_()
    now = torch.cat([views.now for views in batches]).requires_grad_()
    logits = network.logits(Views(before, now, torch.cat([views.time for views in batches])))
    gradients = torch.autograd.grad(logits.sum(), [before, now], create_graph=True, materialize_grads=True)
    return torch.stack([gradient.square().sum() for gradient in gradients]).sum() / len(now)


class LearnedReward:
    """What R discriminators make of the agents' frames; see ``interfaces.RewardSource``.

    After an iteration each takes ``params.steps`` Adam steps on batches of the newest ``params.memory``
    episodes of its agent and of ``sets[r]``, run r's sets of others' clips by name. The newest
    ``params.rescored`` are then rescored, so that all rewards that a learner hears of have one scale.
    ``networks`` are the discriminators, one a run.
    """

    def __init__(
        self,
        make: Callable[[], Discriminator],
        params: config.Discriminator,
        seed: int,
        runs: Sequence[int],
        sets: Sequence[Mapping[str, ClipSet]],
    ):
        self._params, self._seed, self._runs, self._sets = params, seed, list(runs), list(sets)
        self.networks: list[Discriminator] = []
        with torch.random.fork_rng(devices=[]):
            for run in runs:
                torch.manual_seed(torch_seed(seed, "discriminator-weights", run))
                self.networks.append(make())
        self._modules = nn.ModuleList(self.networks)
        self._optimizer = torch.optim.Adam(self._modules.parameters(), params.learning_rate)
        self._shape = sets[0]["expert"].frames.shape[1:]
        self._iteration = 0
        self._seen = np.zeros((len(self._runs), 0, *self._shape), np.uint8)
        self._features: list[list[Tensor]] = []  # of each run's newest frames
        self._memory = np.zeros((len(self._runs), params.memory, *self._shape), np.uint8)  # a ring
        self._written = 0

    @torch.inference_mode()
    def step(self, frames: np.ndarray, step: int) -> np.ndarray:
        """Rewards (R, C) of ``frames`` (R, C, H, W, 3) seen after action ``step`` (1 to T)."""
        runs, copies = frames.shape[:2]
        if step == 1:
            self._seen = np.zeros((runs, copies, *self._shape), np.uint8)
            self._features = [[] for _ in range(runs)]
        self._seen[:, :, step] = frames
        time = torch.full((copies,), step / (self._shape[0] - 1))
        rewards = []
        for network, features, now in zip(self.networks, self._features, to_input(frames), strict=True):
            features.append(network.features(now))
            del features[: -network.lag - 1]
            rewards.append(network.score(features[0], features[-1], time))
        return torch.stack(rewards).numpy()

    def end_iteration(self) -> Arrays:
        """Learn from the newest episodes; accuracies (R,) on the iteration's frames before that."""
        with torch.inference_mode():
            measures = [
                network.accuracies(self._draw(row, _every(seen), "discriminator-measures", self._iteration))
                for row, (network, seen) in enumerate(zip(self.networks, self._seen, strict=True))
            ]
        newest = self._seen[:, -self._params.memory :]
        self._written += newest.shape[1]
        self._memory[:, self._newest(newest.shape[1])] = newest
        self._iteration += 1
        for index in range(self._params.steps):
            self._learn(index)
        return {name: np.array([each[name].item() for each in measures]) for name in measures[0]}

    @torch.inference_mode()
    def rescored(self) -> np.ndarray:
        """Rewards (R, E, T) of the newest episodes, the oldest of them first."""
        rows = self._newest(self._params.rescored)
        rewards = [
            torch.stack([network.score_clip(episodes[row]) for row in rows])
            for network, episodes in zip(self.networks, self._memory, strict=True)
        ]
        return torch.stack(rewards).numpy()

    def _newest(self, count: int) -> np.ndarray:
        """Where the newest ``count`` episodes are in the memory, or all if it has fewer; the oldest first."""
        capacity = self._memory.shape[1]
        count = min(count, self._written, capacity)
        return (self._written - count + np.arange(count)) % capacity

    def _learn(self, index: int) -> None:
        """One step of every discriminator: a sum of losses that share no weights."""
        batches = (
            self._draw(
                row,
                ClipSet(remembered, self._newest(self._written)),
                "discriminator-batch",
                self._iteration,
                index,
            )
            for row, remembered in enumerate(self._memory)
        )
        losses = [
            self._loss(network, self._shifted(views, run, index))
            for network, views, run in zip(self.networks, batches, self._runs, strict=True)
        ]
        self._optimizer.zero_grad()
        torch.stack(losses).sum().backward()
        self._optimizer.step()

    def _shifted(self, batches: Mapping[str, Views], run: int, index: int) -> dict[str, Views]:
        """Every set's batch, shifted at random."""
        rng = stream(self._seed, "discriminator-shift", run, self._iteration, index)
        return {name: shifted(views, self._params.shift, rng) for name, views in batches.items()}

    def _loss(self, network: Discriminator, views: Mapping[str, Views]) -> Tensor:
        """The network's own loss and the penalty on its gradients."""
        loss, weight = network.loss(views), self._params.gradient_penalty
        if weight:
            loss = loss + weight * gradient_penalty(network, list(views.values()))
        return loss

    def _draw(self, row: int, agent: ClipSet, name: str, *indices: int) -> dict[str, Views]:
        """A batch of each of run ``row``'s sets and of its ``agent`` clips."""
        rng = stream(self._seed, name, self._runs[row], *indices)
        sets = {**self._sets[row], "agent": agent}
        lag, count = self.networks[row].lag, self._params.batch_size
        return {name: clips.draw(rng, count, lag) for name, clips in sets.items()}

    def state(self) -> Arrays:
        """Between iterations: networks, optimiser and remembered episodes."""
        arrays = {f"network/{name}": value.numpy() for name, value in self._modules.state_dict().items()}
        for index, state in self._optimizer.state_dict()["state"].items():
            arrays |= {f"optimizer/{index}/{key}": value.numpy() for key, value in state.items()}
        counts = np.array([self._iteration, self._written])
        return arrays | {"memory": self._memory[:, : self._written], "counts": counts}

    def restore(self, state: Arrays) -> None:
        """Continue from ``state()`` bit for bit."""
        self._memory[:, : state["memory"].shape[1]] = state["memory"]
        self._iteration, self._written = map(int, state["counts"])
        network: dict[str, Tensor] = {}
        moments: dict[int, dict[str, Tensor]] = {}
        for name, array in state.items():
            kind, _, rest = name.partition("/")
            # Copies: the optimiser works in place.
            if kind == "network":
                network[rest] = torch.tensor(array)
            elif kind == "optimizer":
                index, key = rest.split("/")
                moments.setdefault(int(index), {})[key] = torch.tensor(array)
        self._modules.load_state_dict(network)
        self._optimizer.load_state_dict(self._optimizer.state_dict() | {"state": moments})
