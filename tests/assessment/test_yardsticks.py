"""What needs no translator, and the object's place by its colour: against scenes whose geometry is known."""

import cv2
import numpy as np
import pytest

from anyview.assessment.yardsticks import copy_loss, mean_loss, yardsticks
from anyview.pusher.contexts import sample_contexts
from anyview.pusher.render import renderer
from anyview.seeds import stream
from anyview.surrogate.push import sample_push
from anyview.surrogate.scene import OTHER_TARGET_COLOURS, TARGET_COLOUR, Scene, View
from anyview.surrogate.things import place_things
from anyview.surrogate.webcam import Lens, Webcam
from anyview.video.places import find_object
from tests.training.discworld import disc_clips

SIDE = 48
PICTURE, RENDERED = (320, 180), (192, 108)
OBJECT_MIDDLE = 0.03  # metres above the table


def filmed_places(index: int, extreme: bool) -> tuple[np.ndarray, np.ndarray]:
    """Where the rule finds the object in six pictures of a rig scene, and where it is: both (6, 2)."""
    rng = stream(0, "test yardsticks", index)
    push = sample_push(rng)
    lens = Lens(PICTURE, 0.75, -0.13, 0.02)
    view = View(
        rng.uniform(-0.6, 3.7),
        rng.uniform(0.5, 1.2),
        rng.uniform(0.82, 0.98),
        (0, 0, 0.02),
        0.1,
        lens.undistorted()[1],
    )
    colour = OTHER_TARGET_COLOURS[index % 4] if extreme else TARGET_COLOUR
    things = place_things(rng, push, 16 if extreme else 0)
    scene = Scene(push, [view], things, colour, RENDERED, rng)
    webcam = Webcam(lens, RENDERED, rng)
    found, true = [], []
    for time in (0.0, 3.5, 4.5, 5.5, 6.5, 8.0):
        picture = webcam.expose(scene.render(0, time), time)
        square = picture[:, (PICTURE[0] - PICTURE[1]) // 2 :][:, : PICTURE[1]]
        found.append(find_object(cv2.resize(square, (SIDE, SIDE), interpolation=cv2.INTER_AREA)))
        true.append(projected((*push.at(time)[1], OBJECT_MIDDLE), view, lens))
    scene.close()
    return np.array(found), np.array(true)


def projected(point: tuple[float, ...], view: View, lens: Lens) -> np.ndarray:
    """Pixel (2,) of the ingested picture where a camera sees ``point``: pinhole, lens, middle square."""
    level = np.array([np.cos(view.azimuth), np.sin(view.azimuth), 0.0])
    forward = -np.cos(view.elevation) * level - np.array([0.0, 0.0, np.sin(view.elevation)])
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    gap = np.array(point) - np.array(view.target) + view.distance * forward
    ray = np.array([gap @ right, gap @ down]) / (gap @ forward)
    ray = np.array([[np.cos(view.roll), -np.sin(view.roll)], [np.sin(view.roll), np.cos(view.roll)]]) @ ray
    radius2 = ray @ ray
    bent = ray * (1 + lens.k1 * radius2 + lens.k2 * radius2**2)
    height = lens.size[1]
    from_middle = bent * 0.5 * height / np.tan(0.5 * lens.fovy)  # of the picture, and so of the square
    return SIDE / 2 + from_middle * SIDE / height - 0.5


def test_the_object_is_found_where_lens_and_camera_put_it():
    scenes = [filmed_places(index, extreme=index % 2 > 0) for index in range(10)]
    found, true = (np.concatenate([scene[n] for scene in scenes]) for n in (0, 1))
    inside = ((true > 2) & (true < SIDE - 3)).all(axis=1)
    assert inside.sum() > 30
    errors = np.linalg.norm(found - true, axis=1)[inside]
    assert np.median(errors) < 0.5
    assert np.quantile(errors, 0.9) < 1.5  # hand and tool hide a part of it at times


def test_the_simulated_object_is_found_beside_distractors_of_any_colour():
    contexts, _ = sample_contexts(np.random.default_rng(4), 40)
    positions = np.array([[*context.arm_qpos, *context.object_xy] for context in contexts])
    frames = renderer("push", 64).render(contexts, positions)
    bare = renderer("push", 64).render(contexts, positions - [0, 0, 0, 9, 9])  # the object out of sight
    errors = []
    for frame, without in zip(frames, bare, strict=True):
        rows, columns = np.nonzero((frame != without).any(axis=-1))
        errors.append(np.hypot(*(find_object(frame) - [columns.mean(), rows.mean()])))
    assert np.median(errors) < 0.5
    assert np.quantile(errors, 0.95) < 2


def test_pictures_without_a_blue_object_have_no_place():
    rng = np.random.default_rng(0)
    for colour in ((200, 30, 30), (120, 120, 130), (90, 160, 150), (12, 12, 18)):
        frame = np.clip(np.array(colour) + rng.normal(0, 4, (SIDE, SIDE, 3)), 0, 255).astype(np.uint8)
        assert np.isnan(find_object(frame)).all()


def moving_disc(places: list[tuple[float, float]]) -> np.ndarray:
    """A clip (T, 48, 48, 3) of a blue disc at ``places``, x and y."""
    clip = np.full((len(places), SIDE, SIDE, 3), (150, 140, 120), np.uint8)
    for frame, (x, y) in zip(clip, places, strict=True):
        rows, columns = np.mgrid[:SIDE, :SIDE]
        frame[(rows - y) ** 2 + (columns - x) ** 2 < 9] = (30, 50, 160)
    return clip


def test_placed_counts_frames_by_the_distance_from_the_true_place():
    true = moving_disc([(10, 20), (10, 20), (14, 20), (18, 20), (22, 20), (26, 20), (26, 20), (26, 20)])
    late = moving_disc([(10, 20), (10, 20), (10, 20), (17, 20), (22, 21), (20, 20), (26, 20), (26, 20)])
    late[7] = late[7][..., [0, 1, 1]]  # the last frame shows no object
    found = yardsticks(late, true)
    assert found["placed"] == 5 / 8  # not frames 2, 5 and 7
    assert found["placed_on_way"] == 2 / 3  # of frames 2, 3 and 4
    assert found["copy_placed"] == 2 / 8


def test_a_clip_without_the_object_has_losses_alone():
    grey = disc_clips(1)[0][..., [0, 0, 0]]
    found = yardsticks(grey, grey)
    assert np.isnan([found[name] for name in ("placed", "placed_on_way", "copy_placed")]).all()
    assert found["copy_loss"] > found["mean_loss"] > 0
    still = moving_disc([(10, 20)] * 4)
    assert yardsticks(still, still)["placed"] == 1
    assert np.isnan(yardsticks(still, still)["placed_on_way"])


def test_copying_takes_the_best_gain_and_the_mean_is_the_best_still_picture():
    rng = np.random.default_rng(1)
    clip = rng.integers(0, 256, (3, 8, 8, 3)).astype(np.uint8)
    gains = np.stack(
        [
            [
                np.linalg.lstsq(clip[0, ..., c].reshape(-1, 1) / 1.0, clip[t, ..., c].ravel() / 1.0)[0][0]
                for c in range(3)
            ]
            for t in range(3)
        ]
    )
    scaled = clip[0] * gains[:, None, None]
    expected = 50 * np.square((scaled - clip) / 127.5).sum(axis=(1, 2, 3)).mean()
    assert copy_loss(clip) == pytest.approx(expected)
    assert copy_loss(np.stack([clip[0], clip[0] // 2 * 2])) < 200  # a gain mends what exposure does
    variance = clip.var(axis=0).sum() / 127.5**2
    assert mean_loss(clip) == pytest.approx(50 * variance)
