"""Deep deterministic policy gradient (Lillicrap et al. 2016) of R policies in lockstep.

Every tensor has a leading dimension R, one row a run, and rows never mix. Shapes below: C copies of a run's
context act side by side, T steps an episode, O observation and A action sizes, B transitions in a batch.

What is particular here follows from the task, which repeats one episode of fixed length in a fixed context
under a dense reward:

- time is in the observation and the last step is terminal, so that nothing is bootstrapped beyond it;
- the networks also see radial basis functions of time, so that a correction at one step leaves others be;
- the policy's loss penalises the squares of what enters its tanh (Andrychowicz et al. 2017, appendix A): a
  saturated action has no gradient, and early, wrong critics drive actions there for good;
- without noise a mean of the policy's latest weights acts (Polyak and Juditsky 1992), if ``average`` says so:
  each update moves the policy by more than it is off in the end;
- all updates of an iteration follow its episodes, and half of each batch comes from the newest episodes: the
  critic must be sharp where the policy now goes, not where it once went.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from anyview import config
from anyview.learners.common.interfaces import Arrays
from anyview.learners.common.noise import ornstein_uhlenbeck
from anyview.learners.common.policies import with_time_features
from anyview.learners.common.replay import Replay
from anyview.learners.common.stacked import Adam, StackedMLP
from anyview.pusher.batch import ACTION_SIZE, ACTIONS
from anyview.runtime.device import torch_device
from anyview.seeds import stream

Network = Callable[[Tensor], Tensor]


class Transitions(NamedTuple):
    """Transitions (..., width of each field), with what follows n steps later."""

    observations: Tensor
    actions: Tensor
    returns: Tensor
    """Discounted sum of the rewards until then (..., 1)."""
    next_observations: Tensor
    """Observations then."""
    bootstrap_discounts: Tensor
    """Weight of the value then, 0 at the end of the episode (..., 1)."""


def n_step_transitions(
    observations: Tensor,
    actions: Tensor,
    rewards: Tensor,
    next_observations: Tensor,
    discount: float,
    n: int,
) -> Transitions:
    """Transitions (T, ..., width) of episodes of T steps: (T, ..., O), (T, ..., A), (T, ...), (T, ..., O)."""
    horizon, returns = len(rewards), n_step_returns(rewards, discount, n)
    ends = torch.arange(horizon, device=rewards.device).add(n).clamp(max=horizon)  # steps taken by then
    weights = torch.where(ends < horizon, discount**n, 0.0).view(-1, *[1] * rewards.ndim)
    bootstrap_discounts = weights.expand(*rewards.shape, 1)
    return Transitions(
        observations, actions, returns[..., None], next_observations[ends - 1], bootstrap_discounts
    )


def n_step_returns(rewards: Tensor, discount: float, n: int) -> Tensor:
    """Returns (T, ...) of episodes of T steps with ``rewards`` (T, ...).

    At step t it sums discount^k r_(t+k) over n steps or to the end of the episode, which has nothing after
    it.
    """
    returns = torch.zeros_like(rewards)
    for k in range(min(n, len(rewards))):
        returns[: len(rewards) - k] += discount**k * rewards[k:]
    return returns


def minibatch_ages(
    rng: np.random.Generator, updates: int, batch_size: int, newest: int, size: int
) -> np.ndarray:
    """Ages (updates, batch_size) of transitions: half of each batch below ``newest``, half below ``size``."""
    half = batch_size // 2
    late = rng.integers(newest, size=(updates, half))
    return np.hstack([late, rng.integers(size, size=(updates, batch_size - half))])


def critic_targets(policy: Network, critic: Network, batch: Transitions, inputs: Tensor) -> Tensor:
    """Returns plus the discounted value (R, B, 1) by the target networks; ``inputs`` are the next ones."""
    actions = torch.tanh(policy(inputs))
    return batch.returns + batch.bootstrap_discounts * critic(torch.cat([inputs, actions], dim=-1))


def critic_loss(critic: Network, inputs: Tensor, actions: Tensor, targets: Tensor) -> Tensor:
    """Mean squared error of the critic's values (R, 1)."""
    return ((critic(torch.cat([inputs, actions], dim=-1)) - targets) ** 2).mean(1)


def policy_loss(policy: Network, critic: Network, inputs: Tensor, penalty: float) -> Tensor:
    """``penalty`` times the squares of what enters tanh, minus the value of the actions: means (R, 1)."""
    before_tanh = policy(inputs)
    chosen = torch.cat([inputs, torch.tanh(before_tanh)], dim=-1)
    return (penalty * (before_tanh**2).sum(-1, keepdim=True) - critic(chosen)).mean(1)


class DDPG:
    """R learners in lockstep; see ``interfaces.Learner``. An observation's last entry is time in [-1, 1].

    ``runs`` are the runs' indices: row r draws from the streams of ``runs[r]`` alone. ``copies`` episodes of
    ``horizon`` steps are acted in each of ``iterations`` iterations; noise anneals over these.
    """

    def __init__(
        self,
        params: config.DDPG,
        seed: int,
        runs: Sequence[int],
        observation_size: int,
        action_size: int,
        horizon: int,
        copies: int,
        iterations: int,
        device: torch.device,
    ):
        self._params, self._seed, self._runs = params, seed, list(runs)
        self._action_size, self._horizon, self._copies = action_size, horizon, copies
        self._iterations, self._device = iterations, device
        inputs = observation_size + params.time_features
        weights = [stream(seed, "policy", run) for run in self._runs]
        self._policy = StackedMLP.initial([inputs, *params.hidden, action_size], weights, device)
        self._critic = StackedMLP.initial([inputs + action_size, *params.hidden, 1], weights, device)
        self._target_policy, self._target_critic = self._policy.copy(), self._critic.copy()
        self._averaged = self._policy.copy() if params.average else self._policy
        self._policy_adam, self._critic_adam = Adam(self._policy), Adam(self._critic)
        self._widths = [observation_size, action_size, 1, observation_size, 1]  # of ``Transitions``
        self._replay = Replay(len(self._runs), params.replay, sum(self._widths), device)
        self._iteration = 0
        self._begin()

    def _begin(self) -> None:
        """Draw the noise (T, R, C, A) of the next episodes."""
        params, shape = self._params, (self._copies, self._action_size)
        progress = self._iteration / self._iterations
        scale = params.noise * (params.noise_end / params.noise) ** progress
        rngs = [stream(self._seed, "exploration", run, self._iteration) for run in self._runs]
        paths = [ornstein_uhlenbeck(rng, self._horizon, shape, params.noise_theta) for rng in rngs]
        self._noise = scale * np.stack(paths, axis=1)
        self._episode: list[tuple[Tensor, ...]] = []

    def _tensor(self, array: np.ndarray) -> Tensor:
        return torch.from_numpy(np.asarray(array, np.float32)).to(self._device)

    def _input(self, observations: Tensor) -> Tensor:
        return with_time_features(observations, self._params.time_features)

    @torch.no_grad()
    def act(self, observations: np.ndarray, explore: bool) -> np.ndarray:
        """Actions (R, C, A); with the annealed noise where ``explore``."""
        policy = self._policy if explore else self._averaged
        actions = torch.tanh(policy(self._input(self._tensor(observations)))).cpu().numpy()
        if explore:
            actions = np.clip(actions + self._noise[len(self._episode)], -1, 1)
        return actions.astype(np.float32)

    def record(
        self,
        observations: np.ndarray,
        actions: np.ndarray,
        rewards: np.ndarray,
        next_observations: np.ndarray,
        step: int,
    ) -> None:
        """Keep a transition of the current episodes."""
        if step != len(self._episode) + 1:
            raise ValueError(f"step {step} recorded after {len(self._episode)} steps")
        transition = (observations, actions, rewards, next_observations)
        self._episode.append(tuple(map(self._tensor, transition)))

    def end_iteration(self, rescored: np.ndarray | None = None) -> None:
        """Store the episodes; then take the iteration's updates.

        Where there are ``rescored`` (R, E, T) episodes, batches are of these alone: rewards of one scale, as
        in discriminator-actor-critic (Kostrikov et al. 2019).
        """
        params = self._params
        observations, actions, rewards, next_observations = (
            torch.stack(each) for each in zip(*self._episode, strict=True)
        )
        transitions = n_step_transitions(
            observations, actions, rewards, next_observations, params.discount, params.n_step
        )
        rows = torch.cat(transitions, dim=-1).permute(1, 2, 0, 3)  # one episode after the other
        self._replay.add(rows.flatten(1, 2))
        usable = self._replay.size
        if rescored is not None:
            usable = self._rescore(rescored)
        self._iteration += 1
        if self._iteration * self._copies >= params.warmup_episodes:
            for ages in self._minibatches(usable):
                self._update(Transitions(*self._replay.take(ages).split(self._widths, dim=-1)))
        self._begin()

    def _rescore(self, rewards: np.ndarray) -> int:
        """Give the newest episodes the returns of ``rewards`` (R, E, T); the number of their rows."""
        params = self._params
        episodes = self._replay.size // self._horizon
        steps = self._tensor(rewards[:, -episodes:]).permute(2, 0, 1)  # (T, R, E)
        returns = n_step_returns(steps, params.discount, params.n_step).permute(1, 2, 0).flatten(1)
        self._replay.rewrite(self._widths[0] + self._widths[1], returns)
        return returns.shape[1]

    def _minibatches(self, size: int) -> Tensor:
        """The ages (updates, R, B) of the iteration's batches, of the newest ``size`` transitions."""
        params = self._params
        updates = round(params.updates_per_step * self._horizon * self._copies)
        newest = min(size, params.recent_episodes * self._horizon)
        drawn = [
            minibatch_ages(
                stream(self._seed, "replay", run, self._iteration), updates, params.batch_size, newest, size
            )
            for run in self._runs
        ]
        return torch.from_numpy(np.stack(drawn, axis=1)).to(self._device)

    def _update(self, batch: Transitions) -> None:
        """One step of critic, policy and targets on ``batch`` (R, B, width). Losses are summed over runs."""
        params = self._params
        inputs, next_inputs = self._input(batch.observations), self._input(batch.next_observations)
        with torch.no_grad():
            targets = critic_targets(self._target_policy, self._target_critic, batch, next_inputs)
        loss = critic_loss(self._critic, inputs, batch.actions, targets)
        self._critic_adam.descend(loss.sum(), params.critic_learning_rate)
        loss = policy_loss(self._policy, self._critic, inputs, params.preactivation_penalty)
        self._policy_adam.descend(loss.sum(), params.policy_learning_rate)
        if params.average:  # at first of all weights so far
            steps = min(params.average, self._policy_adam.steps)
            self._averaged.flat.lerp_(self._policy.flat, 1 / steps)
        self._target_critic.flat.lerp_(self._critic.flat, params.target_rate)
        self._target_policy.flat.lerp_(self._policy.flat, params.target_rate)

    def policy(self) -> Arrays:
        """``weight<i>`` (R, in, out) and ``bias<i>`` (R, out): ReLU between layers, tanh at the end."""
        arrays: Arrays = {}
        for index, (weight, bias) in enumerate(self._averaged.layers):
            arrays[f"weight{index}"] = weight.detach().cpu().numpy().copy()
            arrays[f"bias{index}"] = bias.detach()[:, 0].cpu().numpy().copy()
        return arrays

    def state(self) -> Arrays:
        """Between iterations: weights, moments, replay. Noise and batches are drawn anew each iteration."""
        tensors = {name: tensor.detach().cpu().numpy() for name, tensor in self._tensors().items()}
        counts = [self._iteration, self._replay.written, self._policy_adam.steps, self._critic_adam.steps]
        return tensors | {"replay": self._replay.contents().cpu().numpy(), "counts": np.array(counts)}

    def restore(self, state: Arrays) -> None:
        """Continue from ``state()`` bit for bit."""
        for name, tensor in self._tensors().items():
            tensor.copy_(torch.from_numpy(state[name]))
        self._iteration, written, self._policy_adam.steps, self._critic_adam.steps = map(int, state["counts"])
        self._replay.restore(torch.from_numpy(state["replay"]).to(self._device), written)
        self._begin()

    def _tensors(self) -> dict[str, Tensor]:
        averaged = {"averaged": self._averaged.flat} if self._params.average else {}
        return averaged | {
            "policy": self._policy.flat,
            "critic": self._critic.flat,
            "target_policy": self._target_policy.flat,
            "target_critic": self._target_critic.flat,
            "policy_mean": self._policy_adam.mean,
            "policy_square": self._policy_adam.square,
            "critic_mean": self._critic_adam.mean,
            "critic_square": self._critic_adam.square,
        }


def make_learner(params: config.Params, runs: Sequence[int], observation_size: int) -> DDPG:
    """Untrained learners for ``runs`` of the pusher."""
    imitation = params.imitation
    return DDPG(
        imitation.ddpg,
        params.base.seed,
        runs,
        observation_size,
        ACTION_SIZE,
        horizon=ACTIONS,
        copies=imitation.episodes_per_iteration,
        iterations=imitation.iterations,
        device=torch_device(),
    )
