"""Demonstrations of any length: a stretch of a raw clip becomes 80 frames, and motion proposes it."""

import json

import cv2
import numpy as np
import pandas as pd
import pytest

from anyview.ingest.clips import Candidate, ingest_clip
from anyview.ingest.motion import moving_stretch, offset, stretches_of_pair
from anyview.ingest.normalize import Refused, Stretch, parse_stretch, read_clip
from tests.cli.test_record_and_clips import run
from tests.ingest.formats import encode
from tests.ingest.raw_clips import LIMITS, pictures, shrunk, write_raw


def film(before: float, moving: float, after: float, fps: float, seed: int = 0) -> np.ndarray:
    """Somebody waits, shows the task for ``moving`` seconds, and waits again."""
    task = pictures(round(moving * fps), seed=seed)
    first, last = task[:1].repeat(round(before * fps), 0), task[-1:].repeat(round(after * fps), 0)
    return np.concatenate([first, task, last])


@pytest.mark.parametrize(("moving", "fps"), [(3.0, 30.0), (3.0, 12.0), (8.0, 25.0), (20.0, 15.0)])
@pytest.mark.parametrize("suffix", [".mp4", ".avi", ".ts"])
def test_frame_k_shows_the_same_progress_whatever_the_length(tmp_path, moving, fps, suffix):
    frames = film(6.0, moving, 1.0, fps)
    encode(tmp_path / f"clip{suffix}", frames, "mpeg4", fps, options={"qmin": "3", "b": "4M", "g": "25"})
    clip = read_clip(tmp_path / f"clip{suffix}", LIMITS, Stretch(6.0, 6.0 + moving))
    small = np.stack([shrunk(frame) for frame in frames])
    for k in (0, 20, 40, 60, 79):
        shown = np.argmin(np.abs(clip[k] - small).mean(axis=(1, 2, 3))) / fps
        if k:  # before the task, all frames are the first
            # A source frame off, and another because neighbours look alike.
            assert abs(shown - (6.0 + k * moving / 80)) <= 2 / fps + 1e-6


def test_a_stretch_of_eight_seconds_from_the_first_frame_is_what_there_is_without_one(tmp_path):
    path = write_raw(tmp_path / "clip.avi", pictures(250), 30.0)
    np.testing.assert_array_equal(read_clip(path, LIMITS, Stretch(0.0, 8.0)), read_clip(path, LIMITS))


@pytest.mark.parametrize(
    ("start", "end", "reason"),
    [
        ("2", "", "start 2, end empty: two numbers of seconds are needed"),
        ("", "9", "start empty, end 9: two numbers"),
        ("soon", "9", "start soon, end 9: two numbers"),
        ("5", "3", "start 5, end 3: the stretch must begin at 0 s or later and end after that"),
        ("-1", "3", "must begin at 0 s or later"),
        ("nan", "3", "must begin at 0 s or later"),
        ("0", "inf", "must begin at 0 s or later"),
        ("1", "1.4", "start 1, end 1.4: it must last 1 to 300 s"),
        ("0", "4000", "it must last 1 to 300 s"),
        ("3", "9", "8.2. s long, its stretch ends at 9 s"),
        ("20", "25", "8.2. s long, its stretch ends at 25 s"),
    ],
)
def test_an_impossible_stretch_is_refused_by_name(tmp_path, start, end, reason):
    write_raw(tmp_path / "clip.avi", pictures())
    candidate = Candidate("clip", "clip.avi", "clip", "", "standard", start, end)
    with pytest.raises(Refused, match=reason):
        raise Refused(ingest_clip(tmp_path, tmp_path, candidate, LIMITS).reason)


def test_no_stretch_is_asked_for_by_two_empty_cells():
    assert parse_stretch("", "") is None


def test_the_stretch_is_where_something_moves():
    changes = np.full(200, 1.0)
    changes[60:130] = 20.0
    start, end = moving_stretch(changes)
    assert 5.2 <= start <= 6.0
    assert 13.0 <= end <= 13.8
    assert moving_stretch(np.full(200, 1.0)) is None
    assert moving_stretch(np.full(200, 15.0)) == (0.0, 20.0)  # no calm moment
    changes[:] = 1.0
    changes[100] = 20.0  # a lamp
    assert moving_stretch(changes) is None


@pytest.mark.parametrize("late", [-30, 0, 17])
def test_views_that_began_at_different_times_get_the_same_moments(late):
    """Each view's stretch begins at the same moment of the task, on its own clock."""
    task = np.zeros(300)
    task[100:160] = 10 + 5 * np.sin(np.arange(60) / 3)
    views = [task[40:280], 0.5 * task[40 + late : 260]]
    assert offset(*views) == late / 10
    first, second = stretches_of_pair(views)
    assert first.start - second.start == pytest.approx(late / 10)
    assert first.end - first.start == pytest.approx(second.end - second.start)
    assert 5.0 <= first.start <= 6.0


def test_propose_finds_both_views_writes_a_sheet_and_ingest_takes_what_it_found(tmp_path, root):
    (tmp_path / "params.yaml").write_text((root / "params.yaml").read_text())
    raw = tmp_path / "raw"
    raw.mkdir()
    encode(raw / "push-left.mp4", film(4.0, 5.0, 2.0, 20.0), "mpeg4", 20.0, options={"b": "4M"})
    encode(raw / "push-right.mov", film(2.5, 5.0, 4.0, 25.0), "mpeg4", 25.0, options={"b": "4M"})
    encode(raw / "still.mp4", film(9.0, 0.1, 0.0, 10.0), "mpeg4", 10.0, options={"b": "4M"})
    (raw / "bad.avi").write_bytes(b"RIFF")
    code, out, err = run("clips", "--propose", "--raw", "raw", "--json", cwd=tmp_path)
    assert (code, err) == (0, "")
    rows = {row["file"]: row for row in json.loads(out)["clips"]}
    left, right = rows["push-left.mp4"], rows["push-right.mov"]
    assert 3.2 <= float(left["start"]) <= 4.1
    assert 8.9 <= float(left["end"]) <= 9.8
    assert float(left["start"]) - float(right["start"]) == pytest.approx(1.5, abs=0.11)
    assert rows["still.mp4"]["reason"] == "nothing moves for long enough"
    assert rows["bad.avi"]["start"] == ""
    table = pd.read_csv(raw / "manifest.proposed.csv", dtype=str, keep_default_na=False)
    assert table.columns.tolist() == ["file", "pair", "camera", "kind", "start", "end"]
    sheet = cv2.imread(str(raw / "manifest.proposed.png"))[..., ::-1]
    clip = read_clip(raw / "push-left.mp4", LIMITS, Stretch(float(left["start"]), float(left["end"])))
    np.testing.assert_array_equal(sheet[:48, 48:96], clip[40])
    code, out, _ = run("clips", "--propose", "--raw", "raw", cwd=tmp_path)
    assert "push-left.mp4: " in out
    assert "nothing moves for long enough" in out
