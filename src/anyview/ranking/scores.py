"""What a reward makes of scripted rollouts: their returns, and the value of the frames of a good one."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from anyview.evaluation.runs import Work, prepare, train
from anyview.learners.common.interfaces import RewardSource
from anyview.pusher.batch import FRAMES
from anyview.pusher.contexts import Context
from anyview.pusher.render import renderer
from anyview.ranking.rollouts import GOOD, final_distances
from anyview.runtime.device import use_threads

TIMES = range(1, FRAMES, 4)
"""Of the frames that are given a value."""

_LOOK_BACK = 3  # steps, at most, from the frame that a reward is for to another that it looks at


def score_group(
    work: Work, scripted: Mapping[str, np.ndarray], scratch: Path
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Score the rollouts ``scripted`` in the contexts of ``work``, by kind, by the reward of its cell.

    A reward that learns does so first, with policies, as it does for its results; it continues from
    ``scratch``. Returns two tables: ``run, kind, rollout, final_distance, return``; and ``run,
    step, value`` of each run's first good rollout (see ``values``).
    """
    use_threads(1)
    prepared = prepare(work)
    runs, contexts = work.runs, work.contexts
    reward = prepared.scoring.reward
    if not prepared.scoring.fixed:
        train(work.cell, prepared, scratch)
    returns = []
    worth = np.empty(0)
    for kind, positions in scripted.items():
        clips = _film(contexts, positions, work.params.sim.image_size)
        if kind == GOOD:
            worth = values(reward, clips[:, 0], TIMES)
        columns = {
            "run": np.repeat(runs, positions.shape[1]),
            "kind": kind,
            "rollout": np.tile(np.arange(positions.shape[1]), len(runs)),
            "final_distance": final_distances(contexts, positions).ravel(),
            "return": rewards(reward, clips).sum(-1).ravel(),
        }
        returns.append(pd.DataFrame(columns))
    columns = {
        "run": np.repeat(runs, len(TIMES)),
        "step": np.tile(TIMES, len(runs)),
        "value": worth.ravel(),
    }
    return pd.concat(returns, ignore_index=True), pd.DataFrame(columns)


def rewards(reward: RewardSource, clips: np.ndarray) -> np.ndarray:
    """Rewards (R, C, 49) of uint8 ``clips`` (R, C, 50, H, W, 3), C of each run."""
    steps = [reward.step(np.ascontiguousarray(clips[:, :, step]), step) for step in range(1, FRAMES)]
    return np.stack(steps, axis=-1)


def values(reward: RewardSource, clips: np.ndarray, times: Sequence[int]) -> np.ndarray:
    """What the frames ``times`` of ``clips`` (R, 50, H, W, 3) are worth by themselves, (R, len(times)).

    The reward of a step says how well a frame fits that step, so that a good clip may earn the same at all of
    them. A frame's value is what the last step earns once the clip ends there: delayed, its first frame held.
    """
    value = np.empty(0)
    for step in (1, *range(FRAMES - _LOOK_BACK - 1, FRAMES)):  # step 1 begins an episode
        shown = np.maximum(0, np.asarray(times) + step - (FRAMES - 1))
        value = reward.step(np.ascontiguousarray(clips[:, shown]), step)
    return value


def _film(contexts: Sequence[Context], positions: np.ndarray, image_size: int) -> np.ndarray:
    """Clips (R, n, 50, H, W, 3) of ``positions`` (R, n, 50, 3 + 2 k)."""
    camera = renderer(contexts[0].task, image_size)
    clips = [
        [camera.render_clip(context, rollout) for rollout in rollouts]
        for context, rollouts in zip(contexts, positions, strict=True)
    ]
    return np.array(clips)
