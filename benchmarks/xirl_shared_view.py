"""Is XIRL sound? Where expert and agent share body and view, its reward must teach the task.

One camera for all, no distractors; objects and the arm's starts are as diverse as ever, and with `goal` the
goal is one, as in XIRL's own tasks. Agents' contexts are of the stream "tuning", never the evaluation's. The
embedding, its training, learner and params are the pipeline's. Agents are rewarded by the distance to the
last frame of one clip in their own context (`own`), or to the mean of 20 last frames in others (`others`),
as `human-xirl` is. Beside the policies: the rewards of last frames whose object is off by some centimetres.

Usage: python benchmarks/xirl_shared_view.py [goal] [UPDATES]   (default: those of the cell)
"""

import math
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import torch

from anyview.config import GoalCell, Params, load_params
from anyview.embedding.network import Embedding
from anyview.evaluation.methods import Group, Method, Scoring, first_demonstration
from anyview.evaluation.runs import Work, evaluate_group
from anyview.learners import ddpg
from anyview.pusher.contexts import Context, sample_contexts
from anyview.pusher.expert import roll_out
from anyview.pusher.render import renderer
from anyview.rewards.goal import GoalReward
from anyview.runtime.device import dtype_of_products, use_threads
from anyview.runtime.scratch import checkpoint_folder
from anyview.seeds import stream
from anyview.training.common.fit import update, validate
from anyview.training.common.optimization import SharedOptimizer
from anyview.training.cycles import CycleObjective
from anyview.video.datasets import Dataset

RUNS, CLIPS, HELD_OUT, SHOWN = 8, 400, 40, 20
OFF = (0.0, 0.02, 0.04, 0.08, 0.16)  # metres
GOAL, NEAR = (0.75, 0.0), 0.08  # metres


def draw(params: Params, name: str, count: int, one_goal: bool) -> tuple[list[Context], np.ndarray]:
    """Contexts of the stream ``name`` before one camera, and where the expert is in each (N, 50, 5)."""
    rng = stream(params.base.seed, name)
    plain: list[Context] = []
    while len(plain) < count:
        for context in sample_contexts(rng, count)[0]:
            goal = GOAL if one_goal else context.goal_xy
            if math.dist(goal, context.goal_xy) < NEAR:
                plain.append(replace(context, goal_xy=goal, azimuth=0.0, distractors=()))
    return plain[:count], roll_out(plain[:count])[0]


def film(params: Params, contexts: list[Context], positions: np.ndarray) -> np.ndarray:
    """Clips (N, T, H, W, 3) of ``positions`` (N, T, 5)."""
    camera = renderer("push", params.sim.image_size)
    return np.stack([camera.render_clip(*each) for each in zip(contexts, positions, strict=True)])


def train(params: Params, clips: np.ndarray, updates: int) -> Embedding:
    """The embedding after ``updates`` on ``clips``, of which the last are held out."""
    splits = np.repeat(["train", "validation"], [len(clips) - HELD_OUT, HELD_OUT])
    names = [f"clip-{number}" for number in range(len(clips))]
    dataset = Dataset("shared", clips, pd.DataFrame({"clip": names, "pair": names, "split": splits}))
    cell = params.beyond.embeddings["xirl"].model_copy(update={"iterations": updates})
    objective = CycleObjective(cell, params.training, params.base.seed, dataset)
    model, held_out = objective.network(), objective.validation()
    dtype = dtype_of_products(params.training.precision, torch.device("cpu"))
    optimizer = SharedOptimizer(model, objective.optimizer, 2, dtype)
    with ThreadPoolExecutor(2) as pool:
        for iteration in range(updates):
            update(objective, optimizer, iteration, pool)
            if (iteration + 1) % max(updates // 5, 1) == 0:
                loss, error = validate(objective, model, held_out, pool).tolist()
                print(f"{iteration + 1} updates: loss {loss:.4f}, time error {error:.3f}", flush=True)
    return model.eval().requires_grad_(False)


def main() -> None:
    """Train the embedding, look at its rewards, train policies by them."""
    params = load_params()
    one_goal = "goal" in sys.argv
    numbers = [int(argument) for argument in sys.argv if argument.isdigit()]
    updates = numbers[0] if numbers else params.beyond.embeddings["xirl"].iterations
    seen = draw(params, "benchmark/xirl", CLIPS, one_goal)
    clips = film(params, *seen)
    model = train(params, clips, updates)

    contexts, positions = draw(params, "tuning", RUNS, one_goal)
    own = film(params, contexts, positions)
    rewards = {
        "own": GoalReward(model, own[:, None], own[:, 0]),
        "others": GoalReward(model, clips[-SHOWN:], own[:, 0]),
    }
    angles = 2 * np.pi * np.arange(8) / 8
    for name, reward in rewards.items():
        found = []
        for off in OFF:
            moved = np.repeat(positions[:, -1:], len(angles), axis=1)
            moved[..., 3:] += off * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
            found.append(reward.step(film(params, contexts, moved), 49).mean())
        print(
            f"{name}: object off by",
            ", ".join(f"{off:g} m {r:.2f}" for off, r in zip(OFF, found, strict=True)),
        )

    cell = params.beyond.cells["human-xirl"]
    assert isinstance(cell, GoalCell)
    params = params.imitating("human-xirl")
    for name, reward in rewards.items():

        def make_reward(group: Group, reward: GoalReward = reward) -> Scoring:
            return Scoring(reward, reward.scales, first_demonstration(group), fixed=True)

        method = Method(ddpg.make_learner, make_reward)
        scratch = checkpoint_folder(["xirl_shared_view", name, updates, one_goal])
        work = Work("human-xirl", params, method, range(RUNS), contexts, own[:1])
        runs = evaluate_group(work, Path(scratch)).runs
        ends = 100 * runs["final_distance"]
        done = f"{runs['success'].sum()} of {RUNS} succeed, median {ends.median():.1f} cm"
        print(f"{name}: {done}; {' '.join(f'{end:.1f}' for end in ends)}", flush=True)


if __name__ == "__main__":
    use_threads(1)
    torch.set_num_threads(1)
    main()
