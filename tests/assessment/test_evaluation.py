"""Likeness, per-clip losses, pictures and feature weights."""

import cv2
import numpy as np
import pandas as pd
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from numpy.lib.stride_tricks import sliding_window_view

from anyview.assessment.evaluation import evaluate, evaluate_clip, translate_clip
from anyview.assessment.importance import feature_weights
from anyview.assessment.similarity import psnr, ssim
from anyview.config import Assessment
from anyview.translator.network import ContextTranslator
from anyview.video.datasets import Dataset
from anyview.video.files import read_video
from anyview.video.pixels import to_frames, to_input
from tests.training.discworld import clip_table, disc_clips


def slow_ssim(x: np.ndarray, y: np.ndarray) -> float:
    """SSIM by its definition: weighted statistics of every 11x11 window of every frame and colour."""
    offsets = np.arange(-5, 6)
    window = np.exp(-(offsets[:, None] ** 2 + offsets**2) / (2 * 1.5**2))
    window /= window.sum()
    values = []
    for a, b in zip(np.moveaxis(x, 3, 1), np.moveaxis(y, 3, 1), strict=True):
        for p, q in zip(a.astype(float), b.astype(float), strict=True):
            p, q = sliding_window_view(p, (11, 11)), sliding_window_view(q, (11, 11))
            mp, mq = ((v * window).sum((-1, -2), keepdims=True) for v in (p, q))
            vp, vq = ((window * (v - m) ** 2).sum((-1, -2)) for v, m in ((p, mp), (q, mq)))
            cov = (window * (p - mp) * (q - mq)).sum((-1, -2))
            mp, mq = mp[..., 0, 0], mq[..., 0, 0]
            c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
            values.append((2 * mp * mq + c1) * (2 * cov + c2) / ((mp**2 + mq**2 + c1) * (vp + vq + c2)))
    return float(np.mean(values))


@given(seed=st.integers(0, 999), noise=st.integers(0, 120))
def test_ssim_is_that_of_its_definition(seed, noise):
    rng = np.random.default_rng(seed)
    clip = disc_clips(1, length=2, seed=seed)[0]
    other = np.clip(clip + rng.integers(-noise, noise + 1, clip.shape), 0, 255).astype(np.uint8)
    assert ssim(other, clip) == pytest.approx(slow_ssim(other, clip), abs=1e-9)
    assert ssim(clip, clip) == pytest.approx(1)


def test_psnr_is_that_of_the_mean_squared_error():
    clip = np.full((3, 8, 8, 3), 100, np.uint8)
    assert psnr(clip + np.uint8(10), clip) == pytest.approx(20 * np.log10(255 / 10))
    assert psnr(clip, clip) == 100.0


@pytest.fixture(scope="module")
def model() -> ContextTranslator:
    torch.manual_seed(3)
    return ContextTranslator("compact", 16).eval().requires_grad_(False)


@pytest.fixture(scope="module")
def views() -> Dataset:
    table = clip_table(["train"] * 2 + ["validation"] * 4 + ["extreme"] * 2, list("ttaabbee"))
    return Dataset("real", disc_clips(8), table.assign(kind="standard"))


def test_a_translated_clip_is_translated_frame_by_frame(model, views):
    clip, context = views.frames[2], views.frames[5, 0]
    translated = translate_clip(model, np.concatenate([clip] * 9), context)
    assert translated.shape == (9 * len(clip), 16, 16, 3)
    z2, skips = model.encode_context(to_input(context[None]))
    for t in (0, 7):
        alone = model.decode(model.translate(model.encode_expert(to_input(clip[t : t + 1])), z2), skips)
        assert abs(translated[t].astype(int) - to_frames(alone)[0]).max() <= 1


def test_losses_of_a_clip_are_means_over_its_frames(model, views):
    evaluated = evaluate_clip(model, views, 2, 3)
    source, target = to_input(views.frames[2]), to_input(views.frames[3])
    z2, skips = model.encode_context(target[:1])
    squares, features = [], []
    for t in range(len(source)):
        z_true = model.encode_expert(target[t : t + 1])
        z3 = model.translate(model.encode_expert(source[t : t + 1]), z2)
        squares.append(float((model.decode(z3, skips) - target[t]).square().sum()))
        features.append(float((z3 - z_true).square().mean()))
    row = evaluated.row
    assert row["translation"] == pytest.approx(50 * np.mean(squares), rel=1e-4)
    assert row["last_frame"] == pytest.approx(50 * squares[-1], rel=1e-4)
    assert row["alignment"] == pytest.approx(1000 * np.mean(features), rel=1e-3)
    assert row["loss"] == pytest.approx(row["translation"] + row["reconstruction"] + row["alignment"])
    true, translated = np.split(evaluated.frames, 2, axis=2)
    assert np.array_equal(true, views.frames[3])
    assert row["psnr"] == pytest.approx(psnr(translated, true))
    assert row["ssim"] == pytest.approx(slow_ssim(translated, true))


def test_evaluation_writes_what_the_report_reads(model, views, tmp_path, monkeypatch):
    params = Assessment(clips=3, shown=2, permutations=4)
    outputs = {}
    for workers in ("1", "2"):
        monkeypatch.setenv("ANYVIEW_WORKERS", workers)
        folder = tmp_path / workers
        folder.mkdir()
        evaluate(model, views, folder, params, np.random.default_rng(0))
        outputs[workers] = {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}
    assert outputs["1"] == outputs["2"]
    clips = pd.read_csv(tmp_path / "1/clips.csv")
    assert list(clips["split"]) == ["validation"] * 3 + ["extreme"] * 2
    assert {"loss", "translation", "reconstruction", "alignment", "psnr", "ssim", "pair"} <= set(clips)
    assert clips.notna().all(axis=None)
    videos = sorted(p.stem for p in (tmp_path / "1/clips").iterdir())
    assert videos == ["clip-002", "clip-003", "clip-006", "clip-007"]
    video = read_video(tmp_path / "1/clips/clip-006.avi")
    assert np.array_equal(video[:, :, :16], views.frames[6])
    strip = cv2.imread(str(tmp_path / "1/strips/clip-006.png"))[..., ::-1]
    assert strip.shape == (32, 3 * 16, 3)  # frames 0, 7 and 11
    assert np.array_equal(strip[:16, 16:32], views.frames[6, 7])
    assert np.array_equal(strip[16:, 32:], video[11, :, 16:])


def test_feature_weights_are_fractions_of_the_rise(model, views):
    table = feature_weights(model, views, [(2, 3), (4, 5)], 5, np.random.default_rng(0))
    assert table["weight"].sum() == pytest.approx(1)
    assert (table["weight"] >= 0).all()
    positive = table["rise"].clip(lower=0)
    assert np.allclose(table["weight"], positive / positive.sum())


def test_frames_that_say_nothing_weigh_the_same(model, views):
    """A clip of one frame all along: replacing a frame changes nothing."""
    still = Dataset("real", np.repeat(views.frames[:, :1], 12, axis=1), views.clips)
    table = feature_weights(model, still, [(2, 3)], 5, np.random.default_rng(0))
    assert np.allclose(table["rise"], 0, atol=1e-2)
    assert table["weight"].sum() == pytest.approx(1)


def test_only_frames_that_differ_have_weight(model, views):
    """All frames alike but one: that one's replacement costs most, whatever the network."""
    frames = np.repeat(views.frames[:, :1], 12, axis=1)
    frames[:, 5] = 255 - frames[:, 5]
    table = feature_weights(
        model, Dataset("real", frames, views.clips), [(2, 3)], 11, np.random.default_rng(0)
    )
    assert table["rise"].abs().idxmax() == 5
