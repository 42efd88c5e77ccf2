"""The surrogate rig: what it films is what the task asks for, and the same every time."""

import hashlib

import cv2
import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anyview.config import Ingest
from anyview.ingest.normalize import read_clip
from anyview.seeds import stream
from anyview.surrogate.film import film, plan
from anyview.surrogate.push import CUP_DEPTH, CUP_HALF_WIDTH, OBJECT_RADIUS, STEP, sample_push
from anyview.surrogate.webcam import Lens, Webcam, frame_times
from anyview.video.files import read_video
from anyview.video.manifests import times_file

LIMITS = Ingest(size=48, frames=80, rate=10.0, max_megabytes=50.0, even_exposure=False)


def test_the_plan_makes_the_clips_of_the_study():
    demonstrations = plan(pairs=71, singles=1, extreme_pairs=5)
    clips = pd.DataFrame(
        [(d.pair, d.kind) for d in demonstrations for _ in d.cameras], columns=["pair", "kind"]
    )
    extreme = clips["kind"] == "extreme_distractor"
    assert (len(clips[~extreme]), len(clips[extreme])) == (143, 10)
    assert clips["pair"].value_counts().value_counts().to_dict() == {2: 76, 1: 1}
    assert set(clips["kind"][~extreme]) == {"standard", "distractor", "extreme_view"}


@settings(max_examples=12)
@given(index=st.integers(0, 10_000))
def test_the_object_moves_only_by_the_cup_and_ends_on_the_target(index):
    push = sample_push(stream(0, "test push", index))
    assert np.linalg.norm(push.object_xy[-1] - push.target_xy) <= 0.02
    assert np.linalg.norm(push.object_xy[0] - push.target_xy) > 0.15
    moved = np.linalg.norm(np.diff(push.object_xy, axis=0), axis=1)
    ahead, aside = to_cup(push.cup[1:], push.object_xy[1:])
    touching = (push.cup[1:, 2] < 0.015) & (np.abs(aside) < CUP_HALF_WIDTH) & (ahead < CUP_DEPTH)
    assert not moved[~touching].any()
    assert (ahead[touching] >= OBJECT_RADIUS - 1e-9).all()  # never inside the crossbar
    assert moved.max() / STEP < 0.5  # metres a second: a hand, not a machine


def to_cup(cup: np.ndarray, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points in the cup's frame, by complex numbers: (ahead of it, aside of it)."""
    gap = (xy[:, 0] - cup[:, 0]) + 1j * (xy[:, 1] - cup[:, 1])
    turned = gap * np.exp(-1j * cup[:, 3])
    return turned.real, turned.imag


@pytest.fixture(scope="module")
def filmed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("film")
    demonstration = plan(1, 0, 0)[0]
    return folder, film(folder, demonstration, 320, seed=7)


def test_filming_again_gives_the_same_bytes(filmed, tmp_path):
    folder, rows = filmed
    assert film(tmp_path, plan(1, 0, 0)[0], 320, seed=7) == rows
    for row in rows:
        for name in (row["file"], times_file(row["file"])):
            first, second = (hashlib.sha256((f / name).read_bytes()).digest() for f in (folder, tmp_path))
            assert first == second


def test_both_views_are_colour_video_with_uneven_times_that_ingest_takes(filmed):
    folder, rows = filmed
    assert [row["camera"] for row in rows] == ["left", "right"]
    left, right = (float(row["azimuth"]) for row in rows)
    assert 95 <= left <= 215  # one camera on each side of the operator
    assert not 85 < right < 325
    for row in rows:
        frames = read_video(folder / row["file"])
        times = pd.read_csv(folder / times_file(row["file"]))["seconds"].to_numpy()
        assert frames.shape[1:] == (180, 320, 3)
        assert len(times) == len(frames)
        assert times[-1] > 7.9
        assert np.diff(times).std() > 0.003
        assert read_clip(folder / row["file"], LIMITS).shape == (80, 48, 48, 3)


def test_object_and_target_are_visible_and_meet(filmed):
    folder, rows = filmed
    for row in rows:
        clip = read_clip(folder / row["file"], LIMITS).astype(int)
        red, green, blue = np.moveaxis(clip, -1, 0)
        is_object = (blue > red + 35) & (blue > green + 25)
        is_target = (red > blue + 60) & (red > green + 60)
        assert is_object[0].sum() >= 9
        assert is_target[0].sum() >= 9
        target = np.argwhere(is_target[0]).mean(axis=0)
        gaps = [np.linalg.norm(np.argwhere(mask).mean(axis=0) - target) for mask in is_object[[0, 79]]]
        assert gaps[0] > 2 * gaps[1]
        assert gaps[1] < 5


@settings(max_examples=20)
@given(k1=st.floats(-0.17, 0.0), k2=st.floats(0.02, 0.05), fovy=st.floats(0.5, 0.8))
def test_the_lens_bends_rays_as_brown_says_and_the_rendered_picture_covers_them(k1, k2, fovy):
    lens = Lens((64, 36), fovy, k1, k2)
    rays, rendered_fovy = lens.undistorted()
    radius2 = (rays**2).sum(axis=-1, keepdims=True)
    bent = rays * (1 + k1 * radius2 + k2 * radius2**2)
    focal = 18 / np.tan(fovy / 2)
    pixels = bent * focal + [31.5, 17.5]
    expected = np.stack(np.meshgrid(np.arange(64), np.arange(36)), axis=-1)
    np.testing.assert_allclose(pixels, expected, atol=0.02)
    assert np.abs(rays[..., 1]).max() <= np.tan(rendered_fovy / 2) + 1e-9
    assert np.abs(rays[..., 0]).max() <= np.tan(rendered_fovy / 2) * 64 / 36 + 1e-9


def test_the_webcam_adds_noise_and_drift_but_keeps_the_picture():
    picture = np.full((90, 160, 3), 120, np.uint8)
    cv2.rectangle(picture, (60, 30), (100, 60), (190, 30, 30), -1)
    webcam = Webcam(Lens((160, 90), 0.75, -0.13, 0.02), (160, 90), stream(3, "test webcam"))
    frames = np.stack([webcam.expose(picture, 0.1 * k) for k in range(60)]).astype(float)
    centre = frames[:, 35:55, 70:90]
    assert 0.5 < centre.std(axis=0).mean() < 25  # noise and drift
    assert frames.mean(axis=(1, 2, 3)).std() > 0.3  # exposure
    assert (centre[..., 0] > centre[..., 2] + 60).all()  # red stays red


@given(seed=st.integers(0, 500))
@settings(max_examples=40)
def test_frame_times_increase_without_long_gaps_and_fill_a_clip(seed):
    times = frame_times(stream(seed, "test times"), 8.15)
    assert (np.diff(times) > 0).all()
    assert np.diff(times).max() < 0.3
    assert times[0] < 0.06
    assert 7.85 < times[-1] < 8.15
