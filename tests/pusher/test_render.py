"""What the camera sees, against the pinhole equation and against small motions."""

import numpy as np
import pytest

from anyview.pusher.batch import PusherBatch
from anyview.pusher.contexts import Context, Distractor, sample_contexts
from anyview.pusher.render import renderer


def test_the_goal_is_where_a_pinhole_camera_sees_it() -> None:
    for azimuth in (0.0, 0.7, 2.0, -2.5):
        goal = (0.75, 0.2)
        context = Context(azimuth, (0.4, -0.2), goal, (1.0, 1.0, 1.0), ())
        frame = (
            renderer("push", 64).render([context], np.array([[2.7, 0.5, 0.5, 0.4, -0.2]]))[0].astype(float)
        )
        red = (frame[..., 0] > 150) & (frame[..., 2] < 80)
        rows, columns = np.nonzero(red)
        elevation = np.deg2rad(-60.0)
        forward = np.array(
            [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
        )
        camera = np.array([0.62, 0.0, 0.0]) - 2.6 * forward
        right = np.cross(forward, [0, 0, 1])
        right /= np.linalg.norm(right)
        up = np.cross(right, forward)
        ray = np.array([*goal, 0.008]) - camera
        focal = 32 / np.tan(np.deg2rad(28.0) / 2)
        column = 32 + focal * (ray @ right) / (ray @ forward) - 0.5
        row = 32 - focal * (ray @ up) / (ray @ forward) - 0.5
        assert columns.mean() == pytest.approx(column, abs=0.5)
        assert rows.mean() == pytest.approx(row, abs=0.5)


@pytest.mark.parametrize("task", ["push", "strike", "sweep"])
def test_one_centimetre_of_object_motion_shows_clearly(task: str) -> None:
    contexts, _ = sample_contexts(np.random.default_rng(2), 8, task=task)
    batch = PusherBatch(contexts)
    batch.reset()
    here = batch.positions()
    for shift in ((0.01, 0), (0, 0.01)):
        there = here.copy()
        there[:, 3:] += np.tile(shift, (here.shape[1] - 3) // 2)
        change = np.abs(
            renderer(task, 64).render(contexts, there).astype(int) - renderer(task, 64).render(contexts, here)
        )
        assert ((change.max(-1) > 25).sum((1, 2)) >= 8).all()


def test_hidden_distractors_leave_no_trace_and_visible_ones_do() -> None:
    def scene(visible: bool) -> Context:
        return Context(
            0.3, (0.4, -0.2), (0.8, 0.2), (1.0, 1.0, 1.0), (Distractor((0.6, 0.3), (0, 1, 0), visible),)
        )

    position = np.array([[1.0, 1.0, 1.0, 0.4, -0.2]])
    hidden, shown = (renderer("push", 64).render([scene(v)], position)[0] for v in (False, True))
    bare = renderer("push", 64).render(
        [Context(0.3, (0.4, -0.2), (0.8, 0.2), (1.0, 1.0, 1.0), ())], position
    )[0]
    np.testing.assert_array_equal(hidden, bare)
    assert ((shown[..., 1] > 150) & (shown[..., 0] < 90)).sum() >= 8


def test_frames_are_the_same_in_any_company() -> None:
    contexts, _ = sample_contexts(np.random.default_rng(4), 6)
    batch = PusherBatch(contexts)
    batch.reset()
    together = batch.render()
    for index, context in enumerate(contexts):
        clip = renderer("push", 64).render_clip(context, batch.positions()[index : index + 1])
        np.testing.assert_array_equal(clip[0], together[index])
