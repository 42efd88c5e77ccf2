"""Where things are in simulated clips, against MuJoCo's own camera and against the colours in pictures."""

import mujoco
import numpy as np
import pandas as pd
import pytest

from anyview.pusher.contexts import sample_contexts
from anyview.pusher.expert import roll_out
from anyview.pusher.render import renderer
from anyview.pusher.scene import ARENA_CENTRE, CAMERA_DISTANCE, CAMERA_ELEVATION, FINGER_HEIGHT
from anyview.pusher.task import load_task
from anyview.runtime.errors import AnyviewError
from anyview.seeds import stream
from anyview.training.simulated_marks import project, simulated_marks
from anyview.video.datasets import Dataset
from anyview.video.places import find_object

SIZE = 64


@pytest.fixture(scope="module")
def simulated():
    """Ten clips, with the positions that they show."""
    contexts, _ = sample_contexts(stream(3, "test"), 10)
    positions, _ = roll_out(contexts)
    camera = renderer("push", SIZE)
    frames = np.stack([camera.render_clip(*each) for each in zip(contexts, positions, strict=True)])
    return contexts, positions, _described(contexts, frames)


@pytest.fixture(scope="module")
def marks(simulated):
    return simulated_marks(simulated[2])


def test_points_are_seen_where_the_camera_of_mujoco_sees_them():
    """Its position, axes and frustum, of which ours are independent."""
    model = load_task("push").model("twist")
    data, option, camera = mujoco.MjData(model), mujoco.MjvOption(), mujoco.MjvCamera()
    scene = mujoco.MjvScene(model, maxgeom=64)
    rng = np.random.default_rng(0)
    for azimuth in rng.uniform(-np.pi, np.pi, 5):
        camera.lookat[:] = [*ARENA_CENTRE, 0.0]
        camera.distance, camera.elevation = CAMERA_DISTANCE, CAMERA_ELEVATION
        camera.azimuth = np.rad2deg(azimuth)
        mujoco.mjv_updateScene(model, data, option, None, camera, mujoco.mjtCatBit.mjCAT_ALL, scene)
        left, right = scene.camera
        here = (np.array(left.pos) + right.pos) / 2  # MuJoCo has two eyes
        forward, up = np.array(left.forward), np.array(left.up)
        points = np.append(ARENA_CENTRE, 0.0) + rng.uniform(-0.6, 0.6, (20, 3))
        depth = (points - here) @ forward
        slope = left.frustum_top / left.frustum_near
        x, y = (points - here) @ np.cross(forward, up) / depth / slope, (points - here) @ up / depth / slope
        np.testing.assert_allclose(project(points, azimuth), np.stack([x, -y], -1), atol=1e-5)


def test_marks_are_where_object_target_and_tool_are_seen(simulated, marks):
    """By their colours, with nothing in front of the target in the first frame and of the object mostly."""
    _, _, dataset = simulated
    assert marks.shape == (10, 50, 5, 2)
    assert marks.dtype == np.float32
    found = np.stack([[find_object(frame) for frame in clip[::7]] for clip in dataset.frames])
    away = np.hypot(*np.moveaxis(found - marks[:, ::7, 0], -1, 0))
    assert np.nanmedian(away) < 0.5
    assert np.nanquantile(away, 0.95) < 1.5
    red_as_blue = dataset.frames[:, 0, :, :, ::-1]
    targets = np.stack([find_object(_without_distractors(frame)) for frame in red_as_blue])
    assert np.nanmedian(np.hypot(*(targets - marks[:, 0, 1]).T)) < 0.5
    assert np.abs(marks[:, -1, 0] - marks[:, -1, 1]).max() < 1.5  # the object, taller, ends on the target
    assert np.array_equal(marks[:, 0, 1], marks[:, -1, 1])


def test_two_goals_are_marked_in_the_order_of_their_colours():
    """Whichever the expert chose: no mark of a first frame tells which that is."""
    contexts, _ = sample_contexts(stream(3, "test"), 4, "choice")
    contexts = [context.choosing(colour) for context in contexts for colour in ("red", "green")]
    positions, _ = roll_out(contexts)
    camera = renderer("push", SIZE)
    frames = np.stack([camera.render_clip(*each) for each in zip(contexts, positions, strict=True)])
    found = simulated_marks(_described(contexts, frames))
    assert found.shape == (8, 50, 6, 2)
    assert np.array_equal(found[::2, 0], found[1::2, 0])
    for first, marks in zip(frames[:, 0], found[:, 0], strict=True):
        for place, channel in ((1, 0), (5, 1)):
            column, row = marks[place].round().astype(int)
            assert first[row, column].argmax() == channel
    ends = np.abs(found[:, -1, :1] - found[:, -1, [1, 5]]).max(-1)
    assert (ends.argmin(1) == [0, 1] * 4).all()
    assert ends.min(1).max() < 1.5


@pytest.mark.parametrize(("task", "moving"), [("reach", 0), ("strike", 1), ("sweep", 5)])
def test_other_tasks_have_the_middle_of_their_objects_or_the_tool_marked(task: str, moving: int):
    contexts, _ = sample_contexts(stream(3, "test"), 4, "diverse", task)
    positions, _ = roll_out(contexts)
    frames = np.empty((4, 50, SIZE, SIZE, 3), np.uint8)
    found = simulated_marks(_described(contexts, frames))
    assert found.shape == (4, 50, 5, 2)
    if not moving:
        assert np.array_equal(found[:, :, 0], found[:, :, 2])
        return
    middle = positions[..., 3:].reshape(4, 50, moving, 2).mean(2)
    raised = np.concatenate([middle, np.full((4, 50, 1), FINGER_HEIGHT)], -1)
    azimuths = np.array([context.azimuth for context in contexts])[:, None]
    np.testing.assert_allclose(found[:, :, 0], SIZE / 2 * (project(raised, azimuths) + 1) - 0.5, atol=1e-4)


def _described(contexts: list, frames: np.ndarray) -> Dataset:
    return Dataset("set", frames, pd.DataFrame({"context": [context.to_json() for context in contexts]}))


def _without_distractors(frame: np.ndarray) -> np.ndarray:
    """What is not of the target's colour, here in the channel of blue, made grey."""
    channels = frame.astype(int)
    is_target = channels[..., 2] > 3 * channels[..., :2].max(-1)
    return np.where(is_target[..., None], frame, 128).astype(np.uint8)


def test_joints_are_those_of_the_arm_or_where_it_leaves_the_picture(simulated, marks):
    """The links' ends in MuJoCo's own kinematics."""
    contexts, positions, _ = simulated
    model = load_task("push").model("twist")
    data = mujoco.MjData(model)
    inside = 0
    for clip, step in ((0, 0), (1, 10), (2, 30), (3, 49), (4, 20), (5, 45)):
        data.qpos[:] = positions[clip, step]
        mujoco.mj_kinematics(model, data)
        ends = np.array([data.body("link2").xpos, data.body("link1").xpos])
        seen = 0.5 * SIZE * (project(ends, contexts[clip].azimuth) + 1) - 0.5
        for joint, place in zip((3, 4), seen, strict=True):
            mark, before = marks[clip, step, joint], marks[clip, step, joint - 1]
            if (np.abs(place - (SIZE - 1) / 2) < SIZE / 2).all():
                inside += 1
                np.testing.assert_allclose(mark, place, atol=1e-3)
            else:
                assert np.abs(np.abs(mark - (SIZE - 1) / 2).max() - SIZE / 2) < 1e-3  # on the edge
                (ax, ay), (bx, by) = mark - before, place - before
                if joint == 3:
                    assert abs(ax * by - ay * bx) < 1e-2  # on the way
    assert inside >= 3


def test_a_set_that_tells_no_contexts_is_refused(simulated):
    _, _, dataset = simulated
    with pytest.raises(AnyviewError, match=r"data/clips/diverse/manifest\.csv: no column context"):
        simulated_marks(Dataset("diverse", dataset.frames, dataset.clips.drop(columns="context")))
