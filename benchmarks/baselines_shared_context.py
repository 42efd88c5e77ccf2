"""Are GAIL and TPIL sound? With expert and agent in one shared context each must do the task.

Contexts are of the stream "tuning", never the evaluation's. Each run sees one clip of the expert in the
agent's own context (and TPIL wrong pushes there); reward, learner and params are the pipeline's. The expert
is seen from the agent's view, or from a camera that is turned by VIEW degrees in every context. Measured are
the mean distance, over the 49 steps, from the object to where the expert has it, and the final distance from
object to goal, both with the policies' noise off. A method succeeds where 6 of 8 runs end within 2 cm.

Usage: python benchmarks/baselines_shared_context.py [gail|tpil] [VIEW]   (default: both, 0)
"""

import sys
from dataclasses import replace

import numpy as np
import torch

from anyview.adversarial.common.discriminators import ClipSet, LearnedReward
from anyview.adversarial.gail import gail_reward
from anyview.adversarial.tpil import tpil_reward, wrong_pushes
from anyview.analysis.statistics import bootstrap_interval
from anyview.config import Params, load_params
from anyview.evaluation.methods import MakeLearner
from anyview.evaluation.runs import explore
from anyview.learners import ddpg, trpo
from anyview.learners.common.interfaces import Learner
from anyview.pusher.batch import PusherBatch, observation_size
from anyview.pusher.contexts import Context, sample_contexts
from anyview.pusher.episodes import episode
from anyview.pusher.expert import roll_out
from anyview.pusher.kinematics import wrap
from anyview.pusher.render import renderer
from anyview.seeds import stream

RUNS, BYSTANDERS, POINTS = 8, 10, 10
TOLERANCE = 0.02
LEARNERS: dict[str, MakeLearner] = {"ddpg": ddpg.make_learner, "trpo": trpo.make_learner}


def make_reward(method: str, params: Params, seen: list[Context], clips: np.ndarray) -> LearnedReward:
    """The reward of ``method`` where run r's expert clip is ``clips[r]``, filmed in ``seen[r]``."""
    seed, runs, discriminator = params.base.seed, range(len(seen)), params.adversarial.discriminator
    experts = [ClipSet(clips, np.array([run])) for run in runs]
    if method == "gail":
        return gail_reward(discriminator, seed, runs, experts)
    repeated = [context for context in seen for _ in range(BYSTANDERS)]
    pushes = wrong_pushes(repeated, stream(seed, "benchmark"), clips.shape[2])
    rows = np.arange(len(pushes)).reshape(len(seen), BYSTANDERS)
    return tpil_reward(discriminator, seed, runs, experts, [ClipSet(pushes, own) for own in rows])


def perform(pushers: PusherBatch, learner: Learner, expert: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean distance (R,) of the object from where ``expert`` (R, 50, 5) has it, and final distance (R,)."""
    away = [
        np.linalg.norm(pushers.positions()[:, 3:] - expert[:, now.step, 3:], axis=-1)
        for now in episode(pushers, lambda now: learner.act(now.observations[:, None], explore=False)[:, 0])
    ]
    return np.mean(away[1:], axis=0), pushers.distance()


def shared_context(method: str, view: int) -> None:
    """Train RUNS runs of ``method`` and print what they do, against the same policies untrained."""
    params = load_params()
    imitation, control, size = params.imitation, params.sim.control, params.sim.image_size
    contexts, _ = sample_contexts(stream(params.base.seed, "tuning"), RUNS)
    turned = [float(wrap(np.array(context.azimuth + np.deg2rad(view)))) for context in contexts]
    seen = [replace(context, azimuth=azimuth) for context, azimuth in zip(contexts, turned, strict=True)]
    expert, _ = roll_out(contexts)
    camera = renderer("push", size)
    clips = np.stack([camera.render_clip(*each) for each in zip(seen, expert, strict=True)])
    reward = make_reward(method, params, seen, clips)
    learner = LEARNERS[params.adversarial.cells[method].learner](
        params, range(RUNS), observation_size("push", 1)
    )
    copies = imitation.episodes_per_iteration
    acting = PusherBatch([context for context in contexts for _ in range(copies)], control, size)
    testing = PusherBatch(contexts, control, size)
    before = after = perform(testing, learner, expert)
    shown = {imitation.iterations * (point + 1) // POINTS for point in range(POINTS)}
    print(f"{method}, the expert's view turned by {view} degrees: {RUNS} contexts; metres, medians")
    print(f"{'episodes':>10}{'from expert':>14}{'final distance':>16}{'successes':>11}  accuracies")
    print(f"{0:10}{np.median(before[0]):14.3f}{np.median(before[1]):16.3f}")
    for iteration in range(1, imitation.iterations + 1):
        explore(acting, learner, reward, RUNS)
        measures = reward.end_iteration()
        learner.end_iteration(reward.rescored())
        if iteration in shown:
            after = perform(testing, learner, expert)
            told = ", ".join(f"{name.split('_')[0]} {value.mean():.2f}" for name, value in measures.items())
            print(
                f"{iteration * copies:10}{np.median(after[0]):14.3f}{np.median(after[1]):16.3f}"
                f"{(after[1] < TOLERANCE).sum():11}  {told}",
                flush=True,
            )
    for name, one, other in zip(("distance from the expert's", "final distance"), before, after, strict=True):
        low, high = bootstrap_interval(one - other, np.mean, stream(0, "benchmark", 1))
        better = int((other < one).sum())
        print(
            f"{name}: {better} of {RUNS} runs better, by {np.mean(one - other):.3f} ({low:.3f} to {high:.3f})"
        )


if __name__ == "__main__":
    torch.set_num_threads(1)
    views = [int(argument) for argument in sys.argv[1:] if argument.isdigit()]
    for method in [argument for argument in sys.argv[1:] if not argument.isdigit()] or ["gail", "tpil"]:
        shared_context(method, views[0] if views else 0)
