"""The scripted expert: differential inverse kinematics along the expert's path, on the true state.

It is a source of video only. Its actions are within the agent's own range, so that an agent can do what it
sees.
"""

from collections.abc import Sequence

import numpy as np

from anyview.pusher.batch import MAX_TWIST, PusherBatch
from anyview.pusher.contexts import Context
from anyview.pusher.episodes import Moment, episode
from anyview.pusher.kinematics import tool_pose, wrap
from anyview.pusher.scene import CONTROL_SECONDS
from anyview.pusher.tempo import at_progress


def roll_out(
    contexts: Sequence[Context], progress: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Run the expert in every context, in the script's tempo or by ``progress`` (N, 50): see ``tempo``.

    Returns positions (N, 50, 3 + 2 k) as ``Renderer`` takes them and final distances (N,) in metres, rounded
    to 6 decimals.
    """
    batch = PusherBatch(contexts)
    batch.reset()
    start = batch.positions()
    goal = np.array([c.goal_xy for c in contexts])
    objects = start[:, 3:].reshape(len(contexts), -1, 2)
    reference = batch.task.expert_poses(start[:, :3], objects, goal)
    if progress is not None:
        reference = at_progress(reference, progress)

    def act(now: Moment) -> np.ndarray:
        # Aim at where the path will be after this action: feed-forward and feedback in one.
        error = reference[:, now.step + 1] - tool_pose(batch.positions()[:, :3])
        error[:, 2] = wrap(error[:, 2])
        return error / CONTROL_SECONDS / MAX_TWIST

    positions = np.stack([batch.positions() for _ in episode(batch, act)], axis=1)
    return positions, batch.distance().round(6)
