"""Are GAIL and TPIL sound? With expert and agent in one shared context each must beat an untrained policy.

Contexts are of the stream "tuning", never the evaluation's. Each run sees one clip of the expert in the
agent's own context and view (and TPIL wrong pushes there); reward, learner and params are the pipeline's.
Measured are the mean distance, over the 49 steps, from the object to where the expert has it, and the final
distance from object to goal, both with the policies' noise off. A method succeeds where 6 of 8 runs do.

Usage: python benchmarks/baselines_shared_context.py [gail|tpil] [EPISODES]   (default: both, 1000)
"""

import sys

import numpy as np
import torch

from anyview.adversarial.common.discriminators import ClipSet, LearnedReward
from anyview.adversarial.gail import gail_reward
from anyview.adversarial.tpil import tpil_reward, wrong_pushes
from anyview.analysis.statistics import bootstrap_interval
from anyview.config import Params, load_params
from anyview.evaluation.runs import explore
from anyview.learners.trpo import TRPO
from anyview.pusher.batch import ACTION_SIZE, ACTIONS, PusherBatch, observation_size
from anyview.pusher.contexts import Context, sample_contexts
from anyview.pusher.episodes import episode
from anyview.pusher.expert import roll_out
from anyview.pusher.render import renderer
from anyview.seeds import stream

RUNS, BYSTANDERS, POINTS = 8, 10, 10


def make_reward(method: str, params: Params, contexts: list[Context], clips: np.ndarray) -> LearnedReward:
    """The reward of ``method`` where run r's expert clip is ``clips[r]``, in the run's own context."""
    seed, imitation, runs = params.base.seed, params.imitation, range(len(contexts))
    discriminator = params.adversarial.discriminator
    experts = [ClipSet(clips, np.array([run])) for run in runs]
    if method == "gail":
        return gail_reward(discriminator, seed, runs, experts, imitation.trpo.batch_episodes)
    repeated = [context for context in contexts for _ in range(BYSTANDERS)]
    rng = stream(seed, "benchmark")
    pushes = wrong_pushes(repeated, rng, clips.shape[2])
    rows = np.arange(len(pushes)).reshape(len(contexts), BYSTANDERS)
    bystanders = [ClipSet(pushes, own) for own in rows]
    return tpil_reward(discriminator, seed, runs, experts, bystanders, imitation.trpo.batch_episodes)


def perform(pushers: PusherBatch, learner: TRPO, expert: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean distance (R,) of the object from where ``expert`` (R, 50, 5) has it, and final distance (R,)."""
    away = [
        np.linalg.norm(pushers.positions()[:, 3:] - expert[:, now.step, 3:], axis=-1)
        for now in episode(pushers, lambda now: learner.act(now.observations[:, None], explore=False)[:, 0])
    ]
    return np.mean(away[1:], axis=0), pushers.distance()


def shared_context(method: str, episodes: int) -> None:
    """Train RUNS runs of ``method`` and print what they do, against the same policies untrained."""
    params = load_params()
    copies = params.imitation.trpo.batch_episodes
    contexts, _ = sample_contexts(stream(params.base.seed, "tuning"), RUNS)
    expert, _ = roll_out(contexts)
    camera = renderer("push", params.sim.image_size)
    clips = np.stack([camera.render_clip(*each) for each in zip(contexts, expert, strict=True)])
    reward = make_reward(method, params, contexts, clips)
    learner = TRPO(
        params.imitation.trpo,
        params.base.seed,
        range(RUNS),
        observation_size("push", 1),
        ACTION_SIZE,
        ACTIONS,
    )
    control, size = params.sim.control, params.sim.image_size
    acting = PusherBatch([context for context in contexts for _ in range(copies)], control, size)
    testing = PusherBatch(contexts, control, size)
    before = perform(testing, learner, expert)
    batches = episodes // copies
    shown = {batches * (point + 1) // POINTS for point in range(POINTS)}
    print(f"{method}: {RUNS} contexts; metres, medians")
    print(f"{'episodes':>10}{'from expert':>14}{'final distance':>16}  accuracies")
    print(f"{0:10}{np.median(before[0]):14.3f}{np.median(before[1]):16.3f}")
    for batch in range(1, batches + 1):
        explore(acting, learner, reward, RUNS)
        learner.end_iteration()
        measures = reward.end_iteration()
        if batch in shown:
            after = perform(testing, learner, expert)
            told = ", ".join(f"{name.split('_')[0]} {value.mean():.2f}" for name, value in measures.items())
            print(
                f"{batch * copies:10}{np.median(after[0]):14.3f}{np.median(after[1]):16.3f}  {told}",
                flush=True,
            )
    print(f"success: {int((after[1] < 0.02).sum())} of {RUNS} runs")
    for name, one, other in zip(("distance from the expert's", "final distance"), before, after, strict=True):
        low, high = bootstrap_interval(one - other, np.mean, stream(0, "benchmark", 1))
        better = int((other < one).sum())
        print(
            f"{name}: {better} of {RUNS} runs better, by {np.mean(one - other):.3f} ({low:.3f} to {high:.3f})"
        )


if __name__ == "__main__":
    torch.set_num_threads(1)
    methods = [argument for argument in sys.argv[1:] if not argument.isdigit()] or ["gail", "tpil"]
    episodes = next((int(argument) for argument in sys.argv[1:] if argument.isdigit()), 1000)
    for method in methods:
        shared_context(method, episodes)
