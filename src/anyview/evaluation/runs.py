"""The evaluation of a method: runs in lockstep, each a policy of its own in a context of its own."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from anyview.config import Params
from anyview.evaluation.methods import Group, Method, Scoring
from anyview.learners.common.interfaces import Arrays, Learner, RewardSource
from anyview.pusher.batch import FRAMES, PusherBatch, observation_size
from anyview.pusher.contexts import Context
from anyview.pusher.episodes import Act, Moment, episode, film
from anyview.pusher.expert import roll_out
from anyview.pusher.render import renderer
from anyview.pusher.task import load_task
from anyview.runtime.checkpoints import Checkpoints
from anyview.runtime.device import use_threads
from anyview.runtime.progress import track

_POINTS = 50  # of a learning curve


@dataclass(frozen=True)
class Result:
    """What a group of R runs leaves.

    ``runs`` has a row per run, ``curve`` one per run and point of its curve, ``policies`` weights (R, ...),
    and ``rollouts`` (R, 50, H, 2 W, 3) the agent's frames with the imitated demonstration to their right.
    """

    runs: pd.DataFrame
    curve: pd.DataFrame
    policies: Arrays
    rollouts: np.ndarray


class Work(NamedTuple):
    """A group of runs to train and evaluate, or whose reward is to score: what a worker is given."""

    cell: str
    params: Params
    method: Method
    runs: Sequence[int]
    contexts: Sequence[Context]
    """One of each run."""
    demonstrations: np.ndarray
    """The expert's clips in other contexts: see ``Group.demonstrations``."""


class Prepared(NamedTuple):
    """A group of runs before its training, and where its experts went: ``positions`` (R, 50, 3 + 2 k)."""

    group: Group
    positions: np.ndarray
    learner: Learner
    scoring: Scoring


def groups_of(runs: int, size: int) -> list[range]:
    """Runs 0 to ``runs`` - 1 in groups of at most ``size``: 15 by 8 are 8 and 7.

    ``size`` is a param, and does not follow the number of workers: a run by itself takes other matrix kernels
    than a run among others, which moves last bits (its policy in the 5th update, its features at once).
    Between groups of 2, 4, 7 and 8 no bit differed, but another processor may see it differently.
    """
    return [range(start, min(start + size, runs)) for start in range(0, runs, size)]


def evaluate_group(work: Work, scratch: Path) -> Result:
    """Train and evaluate the runs; continues from ``scratch``."""
    use_threads(1)
    prepared = prepare(work)
    curve = train(work.cell, prepared, scratch)
    group, positions, learner, scoring = prepared
    params, contexts = group.params, group.contexts

    agent, distance, other = _perform(group, learner)
    columns = {
        "run": list(group.runs),
        "success": (distance < load_task(contexts[0].task).tolerance).astype(int),
        "final_distance": distance,
        "return_policy": _returns(scoring, agent),
    }
    if other is not None:
        columns["other_distance"] = other
    if scoring.fixed:
        arm_alone = positions.copy()
        arm_alone[:, :, 3:] = positions[:, :1, 3:]
        columns |= {
            "return_still": _returns(scoring, np.repeat(group.own[:, :1], FRAMES, axis=1)),
            "return_arm_only": _returns(scoring, _film(params, contexts, arm_alone)),
            "return_expert": _returns(scoring, group.own),
        }
    rollouts = np.concatenate([agent, scoring.shown], axis=3)
    return Result(pd.DataFrame(columns), curve, learner.policy(), rollouts)


def prepare(work: Work) -> Prepared:
    """The runs, untrained."""
    name, params, method, runs, contexts, demonstrations = work
    positions, _ = roll_out(contexts)
    own = _film(params, contexts, positions)
    group = Group(params, params.methods[name], runs, contexts, demonstrations, own)
    learner = method.make_learner(params, runs, observation_size(contexts[0].task, len(contexts[0].goals)))
    return Prepared(group, positions, learner, method.make_reward(group))


def train(name: str, prepared: Prepared, scratch: Path) -> pd.DataFrame:
    """Train the policies of cell ``name``, and their reward if it learns; continues from ``scratch``.

    Returns the curves: ``iteration, run, final_distance, return`` and measures. At each point the policies
    act once without noise for their distance; the return is what the exploring episodes earned since the
    point before.
    """
    group, _, learner, scoring = prepared
    checkpoints = Checkpoints(scratch)
    label = f"{name}, runs {group.runs[0]} to {group.runs[-1]}" if len(group.runs) > 1 else name
    params = group.params.imitation
    copies = [context for context in group.contexts for _ in range(params.episodes_per_iteration)]
    control, size = group.params.sim.control, group.params.sim.image_size
    acting = PusherBatch(copies, control, size)
    testing = PusherBatch(group.contexts, control, size)
    points = set(
        np.linspace(0, params.iterations, min(_POINTS, params.iterations) + 1).round().astype(int)[1:]
    )
    rows: list[dict[str, float]] = []
    since: list[Arrays] = []
    start = 0
    if (saved := checkpoints.load()) is not None:
        start, arrays, state = saved
        rows, since = state["rows"], [{k: np.array(v) for k, v in each.items()} for each in state["since"]]
        learner.restore(_part(arrays, "learner."))
        scoring.reward.restore(_part(arrays, "reward."))
    with track(label, params.iterations, start) as progress:
        for iteration in range(start + 1, params.iterations + 1):
            earned = explore(acting, learner, scoring.reward, len(group.runs))
            learned = scoring.reward.end_iteration()
            learner.end_iteration(scoring.reward.rescored())
            since.append({"return": earned * scoring.scales, **learned})
            note = ""
            if iteration in points:
                distance = _final_distance(testing, learner)
                note = f"{100 * np.median(distance):.1f} cm from the goal"
                means = {key: np.mean([each[key] for each in since], axis=0) for key in since[0]}
                for row, run in enumerate(group.runs):
                    measures = {key: float(mean[row]) for key, mean in means.items()}
                    rows.append(
                        {
                            "iteration": iteration,
                            "run": run,
                            "final_distance": float(distance[row]),
                            **measures,
                        }
                    )
                since = []
            if checkpoints.due():
                own = {f"learner.{k}": v for k, v in learner.state().items()}
                theirs = {f"reward.{k}": v for k, v in scoring.reward.state().items()}
                pending = [{k: v.tolist() for k, v in each.items()} for each in since]
                checkpoints.save(iteration, own | theirs, {"rows": rows, "since": pending})
            progress.advance(note=note)
    return pd.DataFrame(rows)


def explore(batch: PusherBatch, learner: Learner, reward: RewardSource, runs: int) -> np.ndarray:
    """One iteration's episodes: physics, then one pass of rendering and one batch of encoding a step.

    Returns what they earned (R,), the mean over a run's copies.
    """
    copies = batch.count // runs

    def by_run(array: np.ndarray) -> np.ndarray:
        return array.reshape(runs, copies, *array.shape[1:])

    def act(now: Moment) -> np.ndarray:
        return learner.act(by_run(now.observations), explore=True).reshape(batch.count, -1)

    earned = np.zeros((runs, copies))
    for before, now in pairwise(episode(batch, act)):
        rewards = reward.step(by_run(batch.render()), now.step)
        observations, actions = by_run(before.observations), by_run(now.actions)
        learner.record(observations, actions, rewards, by_run(now.observations), now.step)
        earned += rewards
    return earned.mean(axis=1)


def _final_distance(batch: PusherBatch, learner: Learner) -> np.ndarray:
    """Metres (R,) that are left to the goal after an episode without noise."""
    for _ in episode(batch, _greedy(learner)):
        pass
    return batch.distance()


def _perform(group: Group, learner: Learner) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """An episode without noise: frames (R, 50, H, W, 3), and the final distances (R,) in metres.

    The second distances are to the goals that do not count, where there are any.
    """
    batch = PusherBatch(group.contexts, group.params.sim.control, group.params.sim.image_size)
    frames = film(batch, _greedy(learner))
    return frames, batch.distance(), batch.other_distance() if group.contexts[0].choice else None


def _greedy(learner: Learner) -> Act:
    """The learner's actions without noise, one copy of each run's context."""
    return lambda now: learner.act(now.observations[:, None], explore=False)[:, 0]


def _returns(scoring: Scoring, clips: np.ndarray) -> np.ndarray:
    """Returns (R,) of clips (R, 50, H, W, 3), in the equations' units."""
    steps = [scoring.reward.step(np.ascontiguousarray(clips[:, None, t]), t)[:, 0] for t in range(1, FRAMES)]
    return np.sum(steps, axis=0) * scoring.scales


def _film(params: Params, contexts: Sequence[Context], positions: np.ndarray) -> np.ndarray:
    """Frames (R, 50, H, W, 3) of ``positions`` (R, 50, 3 + 2 k)."""
    camera = renderer(contexts[0].task, params.sim.image_size)
    return np.stack([camera.render_clip(*each) for each in zip(contexts, positions, strict=True)])


def _part(arrays: Arrays, prefix: str) -> Arrays:
    return {name.removeprefix(prefix): array for name, array in arrays.items() if name.startswith(prefix)}
