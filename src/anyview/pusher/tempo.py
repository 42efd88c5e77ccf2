"""Tempo: how far the expert's script has come at each frame of a clip, where clips do not keep its time.

A progress of p means that the clip is where the script is at its step p; it need not be whole.
"""

import numpy as np

from anyview.pusher.path import FRAMES
from anyview.pusher.task import load_task
from anyview.runtime.errors import AnyviewError

DECIMALS = 2  # of a progress, which a manifest has as text
_STRETCH = (0.7, 1.4)  # of a phase
_LAST_END = 48.0  # frames, at most, until the last phase ends


def draw_progress(rng: np.random.Generator, count: int, task: str) -> np.ndarray:
    """The progress (count, 50) of clips, each phase of ``task`` stretched by a random factor of its own.

    The last phase is followed by a rest. Raises AnyviewError where the task's script has no phases.
    """
    phases = load_task(task).phases
    if not phases:
        raise AnyviewError(f"task {task}: its script has no phases to stretch; set `tempo: script`")
    script = np.array([0, *phases])
    ends = (np.diff(script) * rng.uniform(*_STRETCH, (count, len(script) - 1))).cumsum(axis=1)
    ends *= np.minimum(1.0, _LAST_END / ends[:, -1:])
    last = FRAMES - 1
    progress = [np.interp(np.arange(FRAMES), [0, *each, last], [*script, last]) for each in ends]
    return np.stack(progress).round(DECIMALS)


def at_progress(poses: np.ndarray, progress: np.ndarray) -> np.ndarray:
    """The script's tool ``poses`` (N, 50, 3) at ``progress`` (N, 50), which moves straight between steps."""
    before = np.minimum(progress.astype(int), FRAMES - 2)
    part = (progress - before)[..., None]
    rows = np.arange(len(poses))[:, None]
    return (1 - part) * poses[rows, before] + part * poses[rows, before + 1]
