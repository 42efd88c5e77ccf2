"""Trust-region policy optimisation (Schulman et al. 2015) of R policies in lockstep.

Every tensor has a leading dimension R, one row a run. Rows never mix, so a gradient of a sum over rows is
the stack of each row's own gradient, and one batched product serves all runs. Shapes below: E episodes of T
steps, B = E T transitions, O observation and A action sizes, P policy parameters.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
import torch
from torch import Tensor

from anyview import config
from anyview.learners.common.interfaces import Arrays
from anyview.pusher.batch import ACTION_SIZE, ACTIONS
from anyview.seeds import stream

_LINE_SEARCH_STEPS = 12
_LINE_SEARCH_FACTOR = 0.7
_FOURIER = 64
_RIDGE = 0.1
_CLIP = 10.0  # of observations, in the baseline's features alone


class GaussianPolicy:
    """pi(a|o) = N(MLP(o), exp(log_std)^2): tanh hidden layers, linear mean, one log std per action dimension.

    It holds no weights: ``theta`` (R, P) is the flat vector of each row's weights, biases and log stds.
    """

    def __init__(self, observation_size: int, hidden: Sequence[int], action_size: int):
        widths = [observation_size, *hidden, action_size]
        self._layers = list(pairwise(widths))
        self._action_size = action_size

    def initial(self, rng: np.random.Generator, std: float) -> np.ndarray:
        """One row (P,): orthogonal layers, the last one close to zero so that the first actions are too."""
        parts = []
        for index, (inputs, outputs) in enumerate(self._layers):
            gain = 0.01 if index == len(self._layers) - 1 else np.sqrt(2)
            parts += [gain * _orthogonal(rng, inputs, outputs).ravel(), np.zeros(outputs)]
        return np.concatenate([*parts, np.full(self._action_size, np.log(std))])

    def split(self, theta: Tensor) -> tuple[list[tuple[Tensor, Tensor]], Tensor]:
        """Views of ``theta``: [(weight (R, in, out), bias (R, 1, out)), ...] and log_std (R, 1, A)."""
        layers, start = [], 0
        for inputs, outputs in self._layers:
            middle, end = start + inputs * outputs, start + (inputs + 1) * outputs
            weight = theta[:, start:middle].reshape(-1, inputs, outputs)
            layers.append((weight, theta[:, None, middle:end]))
            start = end
        return layers, theta[:, None, start:]

    def distribution(self, theta: Tensor, observations: Tensor) -> tuple[Tensor, Tensor]:
        """Mean (R, B, A) and log std (R, 1, A) for ``observations`` (R, B, O)."""
        layers, log_std = self.split(theta)
        hidden = observations
        for weight, bias in layers[:-1]:
            hidden = torch.tanh(torch.baddbmm(bias, hidden, weight))
        weight, bias = layers[-1]
        return torch.baddbmm(bias, hidden, weight), log_std

    def log_probability(self, theta: Tensor, observations: Tensor, actions: Tensor) -> Tensor:
        """log pi(a|o) (R, B), without the constant -A/2 log(2 pi)."""
        mean, log_std = self.distribution(theta, observations)
        return -(0.5 * ((actions - mean) / log_std.exp()) ** 2 + log_std).sum(-1)

    def divergence(self, old: Tensor, new: Tensor, observations: Tensor) -> Tensor:
        """Mean KL(old || new) over the batch, (R,)."""
        old_mean, old_log_std = self.distribution(old, observations)
        mean, log_std = self.distribution(new, observations)
        spread = (2 * old_log_std).exp() + (old_mean - mean) ** 2
        return (log_std - old_log_std + 0.5 * spread / (2 * log_std).exp() - 0.5).sum(-1).mean(-1)


def _orthogonal(rng: np.random.Generator, inputs: int, outputs: int) -> np.ndarray:
    """Random matrix (inputs, outputs) with orthonormal rows or columns (Saxe et al. 2014)."""
    q, r = np.linalg.qr(rng.standard_normal((max(inputs, outputs), min(inputs, outputs))))
    q = q * np.sign(np.diag(r))
    return q if inputs >= outputs else q.T


def fisher_product(
    policy: GaussianPolicy, theta: Tensor, observations: Tensor, damping: float
) -> Callable[[Tensor], Tensor]:
    """v -> (F + damping I) v, both (R, P); the Fisher matrix F is the Hessian of the mean KL at ``theta``."""
    new = theta.detach().requires_grad_()
    divergence = policy.divergence(theta.detach(), new, observations)
    (gradient,) = torch.autograd.grad(divergence.sum(), new, create_graph=True)

    def product(vector: Tensor) -> Tensor:
        (hessian_vector,) = torch.autograd.grad((gradient * vector).sum(), new, retain_graph=True)
        return hessian_vector + damping * vector

    return product


def conjugate_gradient(product: Callable[[Tensor], Tensor], target: Tensor, steps: int) -> Tensor:
    """Solve ``product(x) = target`` row by row, (R, P). A row that has converged rests."""
    solution = torch.zeros_like(target)
    residual, direction = target.clone(), target.clone()
    square = (residual**2).sum(-1, keepdim=True)
    for _ in range(steps):
        image = product(direction)
        curvature = (direction * image).sum(-1, keepdim=True)
        rate = torch.where(square > 1e-20, square / curvature, 0.0)
        solution += rate * direction
        residual -= rate * image
        new_square = (residual**2).sum(-1, keepdim=True)
        direction = residual + torch.where(square > 1e-20, new_square / square, 0.0) * direction
        square = new_square
    return solution


def discounted_sums(terms: Tensor, rate: float) -> Tensor:
    """sum_k rate^k terms[t + k] to the end of each episode, (R, E, T)."""
    sums = terms.clone()
    for t in range(terms.shape[-1] - 2, -1, -1):
        sums[..., t] += rate * sums[..., t + 1]
    return sums


def advantage_estimates(rewards: Tensor, values: Tensor, discount: float, gae_lambda: float) -> Tensor:
    """Generalised advantage estimates (Schulman et al. 2016) of (R, E, T) episodes.

    The value after the last step is zero: an episode has a fixed length, and time is among the observations.
    """
    deltas = rewards - values
    deltas[..., :-1] += discount * values[..., 1:]
    return discounted_sums(deltas, discount * gae_lambda)


def baseline_features(observations: Tensor) -> Tensor:
    """Features (R, E, T, F), float64, that the baseline is linear in; F = 2 O + 4 + 64.

    [o, o^2, s, s^2, s^3, 1] with s = t/T (Duan et al. 2016) and, because values are seldom that simple, 64
    random Fourier features (Rahimi and Recht 2007) of o and t, both standardised by row. The latter are drawn
    from a fixed stream: they are a function, the same for every seed and run.
    """
    o = observations.double()
    s = torch.linspace(0, 1, o.shape[2], dtype=o.dtype)[:, None].expand(*o.shape[:3], 1)
    x = torch.cat([o, s], dim=-1)
    x = (x - x.mean((1, 2), keepdim=True)) / (x.std((1, 2), keepdim=True) + 1e-6)
    rng = stream(0, "trpo-baseline", x.shape[-1])
    # Frequencies for a Gaussian kernel as wide as the standardised inputs: sqrt(number of inputs).
    frequencies = rng.standard_normal((x.shape[-1], _FOURIER)) / np.sqrt(x.shape[-1])
    waves = torch.cos(
        x @ torch.from_numpy(frequencies) + torch.from_numpy(rng.uniform(0, 2 * np.pi, _FOURIER))
    )
    o = o.clamp(-_CLIP, _CLIP)
    return torch.cat([o, o**2, s, s**2, s**3, torch.ones_like(s), waves], dim=-1)


def fitted_values(features: Tensor, returns: Tensor) -> Tensor:
    """Ridge regression of ``returns`` (R, E, T) on ``features`` (R, E, T, F), row by row: its predictions.

    The fit is to the very batch whose advantages it serves: with B well above F the bias is small, and no
    policy step is lost to the values of an older policy.
    """
    x, y = features.flatten(1, 2), returns.double().flatten(1).unsqueeze(-1)
    gram = x.mT @ x + _RIDGE * torch.eye(x.shape[-1], dtype=x.dtype)
    fit = x @ torch.linalg.solve(gram, x.mT @ y)
    return fit.reshape(returns.shape).to(returns.dtype)


class TRPO:
    """R learners in lockstep; see ``interfaces.Learner``.

    ``runs`` are the runs' indices: row r draws from streams of ``runs[r]`` alone. Episodes last ``horizon``
    steps. A policy step is taken once ``batch_episodes`` episodes have been gathered.
    """

    def __init__(
        self,
        params: config.TRPO,
        seed: int,
        runs: Sequence[int],
        observation_size: int,
        action_size: int,
        horizon: int,
    ):
        self._params, self._seed, self._runs, self._horizon = params, seed, list(runs), horizon
        self._action_size = action_size
        self._network = GaussianPolicy(observation_size, params.hidden, action_size)
        rows = [self._network.initial(stream(seed, "trpo-weights", run), params.initial_std) for run in runs]
        self._theta = torch.from_numpy(np.stack(rows).astype(np.float32))
        self._iteration = 0
        self._batch = self._empty(observation_size)
        self._episode: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self._noise: np.ndarray | None = None
        self._intended: np.ndarray | None = None

    def _empty(self, observation_size: int) -> Arrays:
        rows, steps = len(self._runs), self._horizon
        return {
            "observations": np.zeros((rows, 0, steps, observation_size), np.float32),
            "actions": np.zeros((rows, 0, steps, self._action_size), np.float32),
            "rewards": np.zeros((rows, 0, steps), np.float32),
        }

    def act(self, observations: np.ndarray, explore: bool) -> np.ndarray:
        """Actions (R, C, A), clipped to [-1, 1]. The policy is updated on the actions before clipping."""
        inputs = torch.from_numpy(observations.astype(np.float32))
        mean, log_std = self._network.distribution(self._theta, inputs)
        if not explore:
            return mean.clamp(-1, 1).numpy()
        if self._noise is None:
            self._noise = self._episode_noise(observations.shape[1])
        self._intended = mean.numpy() + log_std.exp().numpy() * self._noise[:, len(self._episode)]
        return self._intended.clip(-1, 1)

    def _episode_noise(self, copies: int) -> np.ndarray:
        """Standard normal noise (R, T, C, A) of this iteration's episodes, from a stream of its own."""
        shape = (self._horizon, copies, self._action_size)
        streams = (stream(self._seed, "trpo-noise", run, self._iteration) for run in self._runs)
        return np.stack([rng.standard_normal(shape, np.float32) for rng in streams])

    def record(
        self,
        observations: np.ndarray,
        actions: np.ndarray,
        rewards: np.ndarray,
        next_observations: np.ndarray,
        step: int,
    ) -> None:
        """Keep a transition of the last exploring ``act``."""
        if self._intended is None or step != len(self._episode) + 1:
            raise ValueError(f"step {step} recorded out of order or without an exploring action")
        self._episode.append((observations, self._intended, rewards))
        self._intended = None

    def end_iteration(self, rescored: np.ndarray | None = None) -> None:
        """Add the iteration's episodes to the batch; take a policy step when the batch is full.

        The batch's newest episodes earn what ``rescored`` (R, E, T) says, where there is any.
        """
        if len(self._episode) != self._horizon:
            raise ValueError(f"an iteration ended after {len(self._episode)} of {self._horizon} steps")
        for key, parts in zip(self._batch, zip(*self._episode, strict=True), strict=True):
            episodes = np.stack(parts, axis=2).astype(np.float32)  # (R, C, T, ...)
            self._batch[key] = np.concatenate([self._batch[key], episodes], axis=1)
        self._episode, self._noise = [], None
        self._iteration += 1
        if rescored is not None:
            known = min(rescored.shape[1], self._batch["rewards"].shape[1])
            self._batch["rewards"][:, -known:] = rescored[:, -known:]
        if self._batch["rewards"].shape[1] >= self._params.batch_episodes:
            self._improve()
            self._batch = self._empty(self._batch["observations"].shape[-1])

    def _improve(self) -> None:
        batch = {key: torch.from_numpy(array) for key, array in self._batch.items()}
        discount = self._params.discount
        returns = discounted_sums(batch["rewards"], discount)
        values = fitted_values(baseline_features(batch["observations"]), returns)
        advantages = advantage_estimates(batch["rewards"], values, discount, self._params.gae_lambda)
        advantages = advantages.flatten(1)
        advantages = advantages - advantages.mean(-1, keepdim=True)
        advantages = advantages / (advantages.std(-1, keepdim=True) + 1e-8)
        observations, actions = batch["observations"].flatten(1, 2), batch["actions"].flatten(1, 2)
        self._theta = policy_step(self._network, self._theta, observations, actions, advantages, self._params)

    def policy(self) -> Arrays:
        """``weight<i>`` (R, in, out) and ``bias<i>`` (R, out): tanh between layers, the output clipped."""
        layers, _ = self._network.split(self._theta)
        weights = {f"weight{i}": weight.numpy() for i, (weight, _) in enumerate(layers)}
        biases = {f"bias{i}": bias[:, 0].numpy() for i, (_, bias) in enumerate(layers)}
        return weights | biases

    def state(self) -> Arrays:
        """Between iterations: weights, gathered episodes and the position in the noise streams."""
        return {"theta": self._theta.numpy(), "iteration": np.array([self._iteration])} | self._batch

    def restore(self, state: Arrays) -> None:
        """Continue from ``state()`` bit for bit."""
        self._theta = torch.from_numpy(state["theta"])
        self._batch = {key: state[key] for key in self._batch}
        self._iteration = int(state["iteration"][0])
        self._episode, self._noise, self._intended = [], None, None


def policy_step(
    policy: GaussianPolicy,
    theta: Tensor,
    observations: Tensor,
    actions: Tensor,
    advantages: Tensor,
    params: config.TRPO,
) -> Tensor:
    """One natural-gradient step of every row, (R, P), from (R, B, ...) transitions.

    Along s = (F + damping I)^-1 g, the step of length sqrt(2 step / s'(F + damping I)s) is shortened until
    the surrogate mean(pi_new/pi_old advantage) rises and the mean KL is at most ``params.step``. A row where
    no length serves stays as it is.
    """
    before = policy.log_probability(theta, observations, actions)

    def surrogate(candidate: Tensor) -> Tensor:
        ratio = (policy.log_probability(candidate, observations, actions) - before).exp()
        return (ratio * advantages).mean(-1)

    variable = theta.detach().requires_grad_()
    reference = surrogate(variable)
    (gradient,) = torch.autograd.grad(reference.sum(), variable)
    product = fisher_product(policy, theta, observations, params.damping)
    direction = conjugate_gradient(product, gradient, params.conjugate_gradient_steps)
    curvature = (direction * product(direction)).sum(-1, keepdim=True)
    full = direction * torch.sqrt(2 * params.step / curvature.clamp_min(1e-12))
    with torch.no_grad():
        result = theta.clone()
        searching = torch.ones(len(theta), dtype=torch.bool)
        for attempt in range(_LINE_SEARCH_STEPS):
            candidate = theta + _LINE_SEARCH_FACTOR**attempt * full
            close = policy.divergence(theta, candidate, observations) <= params.step
            accepted = searching & close & (surrogate(candidate) > reference)
            result[accepted] = candidate[accepted]
            searching &= ~accepted
            if not searching.any():
                break
    return result


def make_learner(params: config.Params, runs: Sequence[int], observation_size: int) -> TRPO:
    """Untrained learners for ``runs`` of the pusher."""
    return TRPO(params.imitation.trpo, params.base.seed, runs, observation_size, ACTION_SIZE, ACTIONS)
