"""TRPO in lockstep against sb3-contrib's TRPO, on Gymnasium's Pendulum-v1 (episodes of 200 steps).

- what they learn: the mean return of the deterministic policies after equal steps, over the same 5 seeds,
  each on the same 20 starts. Batch (10 episodes), network, discount, lambda, divergence bound, damping and
  initial noise are the same; the rest is each one's own, as is sb3-contrib's learned value function;
- how fast: environment steps a second, updates included, of 15 runs in lockstep and of sb3-contrib's one
  after another. Both use one thread; seconds are the processor's, so that a busy machine does not matter.

Usage: python benchmarks/trpo.py [STEPS]   (of each run; default 60000, about 10 minutes)
"""

import sys
import time

import gymnasium
import numpy as np
import sb3_contrib
import torch

from anyview import config
from anyview.learners.trpo import TRPO
from anyview.seeds import stream

TASK, HORIZON, TORQUE = "Pendulum-v1", 200, 2.0
RUNS, COMPARED, STARTS, BATCH = 15, 5, 20, 10
PARAMS = config.TRPO(
    hidden=[64, 64],
    initial_std=0.5,  # of the action range: sb3-contrib's 1 in units of torque
    batch_episodes=BATCH,
    discount=0.9,
    gae_lambda=0.95,
    step=0.01,
    damping=0.1,
    conjugate_gradient_steps=15,
)


def reset_seed(run: int, episode: int) -> int:
    return int(stream(0, "benchmark", run, episode).integers(2**31))


def lockstep(steps: int) -> tuple[TRPO, float]:
    """Train RUNS runs of ``steps`` steps; also the processor's seconds."""
    environments = gymnasium.vector.SyncVectorEnv([lambda: gymnasium.make(TASK)] * RUNS)
    learner = TRPO(PARAMS, 0, range(RUNS), 3, 1, HORIZON)
    started = time.process_time()
    for episode in range(steps // HORIZON):
        observations, _ = environments.reset(seed=[reset_seed(run, episode) for run in range(RUNS)])
        for step in range(1, HORIZON + 1):
            actions = learner.act(observations[:, None], explore=True)
            next_observations, rewards, *_ = environments.step(actions[:, 0] * TORQUE)
            learner.record(observations[:, None], actions, rewards[:, None], next_observations[:, None], step)
            observations = next_observations
        learner.end_iteration()
    return learner, time.process_time() - started


def one_run(seed: int, steps: int) -> tuple[sb3_contrib.TRPO, float]:
    """Train sb3-contrib's TRPO; also the processor's seconds."""
    learner = sb3_contrib.TRPO(
        "MlpPolicy",
        gymnasium.make(TASK),
        n_steps=BATCH * HORIZON,
        batch_size=125,  # of the value function: divides a batch
        gamma=PARAMS.discount,
        gae_lambda=PARAMS.gae_lambda,
        target_kl=PARAMS.step,
        cg_damping=PARAMS.damping,
        cg_max_steps=PARAMS.conjugate_gradient_steps,
        seed=seed,
        device="cpu",
    )
    started = time.process_time()
    learner.learn(steps)
    return learner, time.process_time() - started


def mean_returns(act, rows: int) -> np.ndarray:
    """Mean returns (rows,) over STARTS episodes of policies ``act``: (rows, 3) -> (rows, 1) torques."""
    environments = gymnasium.vector.SyncVectorEnv([lambda: gymnasium.make(TASK)] * rows)
    totals = np.zeros(rows)
    for start in range(STARTS):
        observations, _ = environments.reset(seed=[reset_seed(1000, start)] * rows)
        for _ in range(HORIZON):
            observations, rewards, *_ = environments.step(act(observations))
            totals += rewards
    return totals / STARTS


def main() -> None:
    steps = int(sys.argv[1]) if len(sys.argv) > 1 else 60_000
    torch.set_num_threads(1)
    untrained = mean_returns(lambda o: np.zeros((len(o), 1), np.float32), 1)[0]
    learner, seconds = lockstep(steps)
    ours = mean_returns(lambda o: learner.act(o[:, None], explore=False)[:, 0] * TORQUE, RUNS)
    speed = RUNS * steps / seconds
    theirs, total = [], 0.0
    for seed in range(COMPARED):
        model, seconds = one_run(seed, steps)
        theirs.append(mean_returns(lambda o, model=model: model.predict(o, deterministic=True)[0], 1)[0])
        total += seconds
    other_speed = COMPARED * steps / total
    compared = ours[:COMPARED]
    print(f"{steps} steps a run on {TASK}; no torque at all: {untrained:.0f}")
    print(f"{'':28}{'lockstep':>12}{'sb3-contrib':>12}")
    print(f"{'mean return, 5 seeds':28}{compared.mean():12.0f}{np.mean(theirs):12.0f}")
    print(f"{'each seed, lockstep':28}" + "".join(f"{value:8.0f}" for value in compared))
    print(f"{'each seed, sb3-contrib':28}" + "".join(f"{value:8.0f}" for value in theirs))
    print(f"{'mean return, 15 seeds':28}{ours.mean():12.0f}")
    print(f"{'steps/s over all runs':28}{speed:12.0f}{other_speed:12.0f}   ({speed / other_speed:.1f}x)")
    gain = (compared.mean() - untrained) / (np.mean(theirs) - untrained)
    print(f"gain over no torque: {100 * gain:.0f}% of sb3-contrib's")


if __name__ == "__main__":
    main()
