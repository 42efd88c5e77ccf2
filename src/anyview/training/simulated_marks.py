"""Where things are in simulated clips, by the camera's projection: nothing is rendered, nothing searched for.

Of a clip its manifest has the context. All that moves in it follows from that: the expert acts there again.
"""

import numpy as np

from anyview import paths
from anyview.pusher.contexts import Context
from anyview.pusher.expert import roll_out
from anyview.pusher.scene import (
    ARENA_CENTRE,
    CAMERA_DISTANCE,
    CAMERA_ELEVATION,
    CAMERA_FOVY,
    FINGER_HEIGHT,
    LINK,
)
from anyview.pusher.task import load_task
from anyview.runtime.errors import AnyviewError
from anyview.trigonometry import unit_vector
from anyview.video.datasets import Dataset
from anyview.video.marks import where_leaving

_AT_ONCE = 500  # clips


def simulated_marks(dataset: Dataset) -> np.ndarray:
    """Of each frame of a simulated set the marks that rendered scenes have, float32 (N, 50, M, 2) in pixels.

    These are object, target, tool, and for wrist and elbow the arm's last two joints: instead of one outside
    of the picture the place where the arm leaves it. Of several objects it is their middle, of none the tool.
    Where there are two goals, the target is the first and the second is the sixth mark. Raises AnyviewError
    if the manifest tells no contexts.
    """
    if "context" not in dataset.clips:
        manifest = paths.clip_set(dataset.name) / "manifest.csv"
        raise AnyviewError(f"{manifest}: no column context; run the simulate stage again")
    contexts = [Context.from_json(text) for text in dataset.clips["context"]]
    count = 4 + len(contexts[0].goals)
    marks = np.empty((*dataset.frames.shape[:2], count, 2), np.float32)
    for first in range(0, len(contexts), _AT_ONCE):
        some = contexts[first : first + _AT_ONCE]
        azimuths = np.array([context.azimuth for context in some])
        own = None if dataset.progress is None else dataset.progress[first : first + _AT_ONCE]
        seen = project(_points(some, own), azimuths[:, None, None])
        for joint in (3, 4):
            seen[..., joint, :] = where_leaving(seen[..., joint - 1, :], seen[..., joint, :])
        marks[first : first + _AT_ONCE] = seen
    return 0.5 * dataset.image_size * (marks + 1.0) - 0.5


def project(points: np.ndarray, azimuths: np.ndarray) -> np.ndarray:
    """Where cameras at ``azimuths`` (...) in radians see ``points`` (..., 3) in metres: x and y (..., 2).

    From -1 to 1 in the picture, y downwards.
    """
    ahead, across = unit_vector(azimuths), unit_vector(azimuths - np.pi / 2)
    level, drop = unit_vector(np.deg2rad(CAMERA_ELEVATION))
    flat, height = points[..., :2] - ARENA_CENTRE, points[..., 2]
    forward = (flat * ahead).sum(-1)
    depth = CAMERA_DISTANCE + level * forward + drop * height
    right, up = (flat * across).sum(-1), level * height - drop * forward
    return np.stack([right, -up], -1) / (np.tan(np.deg2rad(CAMERA_FOVY) / 2) * depth)[..., None]


def _points(contexts: list[Context], progress: np.ndarray | None) -> np.ndarray:
    """The marked points (N, 50, M, 3) along the expert's way, in metres."""
    positions, _ = roll_out(contexts, progress)
    links = LINK * unit_vector(np.cumsum(positions[..., :3], axis=-1))
    elbow, wrist, tool = np.moveaxis(np.cumsum(links, axis=-2), -2, 0)
    objects = positions[..., 3:].reshape(*tool.shape[:2], -1, 2)
    middle = objects.mean(axis=2) if objects.shape[2] else tool
    goals = np.array([context.goals for context in contexts])[:, None]
    target, *others = np.moveaxis(np.broadcast_to(goals, (*tool.shape[:2], *goals.shape[2:])), 2, 0)
    flat = np.stack([middle, target, tool, wrist, elbow, *others], axis=-2)
    above = load_task(contexts[0].task).model("twist").body("link0").pos[2]
    heights = np.array([FINGER_HEIGHT, 0.0, FINGER_HEIGHT, above, above, *[0.0] * len(others)])
    return np.concatenate([flat, np.broadcast_to(heights[:, None], (*flat.shape[:-1], 1))], axis=-1)
