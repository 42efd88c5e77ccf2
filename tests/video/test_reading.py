"""Files of every kind that people bring become the same clip, or are refused in one clear line."""

import re

import numpy as np
import pytest

from anyview.ingest.normalize import Refused, read_clip
from anyview.video.files import video_frames
from tests.ingest.formats import DOCUMENT, KINDS, encode, interlaced, row, scene
from tests.ingest.raw_clips import LIMITS, shrunk


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.file)
def test_a_clip_of_each_kind_becomes_what_the_document_says(tmp_path, kind):
    kind.write(tmp_path / kind.file)
    try:
        clip, result = read_clip(tmp_path / kind.file, LIMITS), "good"
    except Refused as refused:
        clip, result = None, str(refused)
    assert row(kind, result) in DOCUMENT.read_text(encoding="utf-8").splitlines()
    if clip is not None:
        expected = scene(100)
        for k in (0, 13, 40, 79):
            # The best match, within a frame of 15 a second before and after.
            errors = [np.abs(clip[k] - shrunk(expected[10 * k + d])).mean() for d in range(-7 if k else 0, 8)]
            assert min(errors) < 6


def test_the_document_has_a_row_for_each_kind_and_no_other():
    listed = re.findall(r"^\| [^|]* \| `([^`]*)` \|", DOCUMENT.read_text(encoding="utf-8"), re.M)
    assert listed == [kind.file for kind in KINDS]


def test_what_is_turned_in_the_file_is_turned_clockwise_by_the_standards_matrix(tmp_path):
    """ISO 14496-12, 8.3.2.3: (x, y) becomes (a x + c y, b x + d y), so b = 1, c = -1 turns right down."""
    encode(tmp_path / "clip.mp4", scene(5), "libx264", 5, turn=-90)
    content = (tmp_path / "clip.mp4").read_bytes()
    header = content.index(b"tkhd")
    matrix = np.frombuffer(content[header + 44 : header + 44 + 36], ">i4")
    assert (matrix[:5] / 65536).tolist() == [0, 1, 0, -1, 0]
    picture = next(video_frames(tmp_path / "clip.mp4")).astype(int)
    assert np.abs(picture - np.rot90(scene(5)[0], -1)).mean() < 12


def test_lines_of_two_moments_are_not_mixed(tmp_path):
    """A bar that moves fast is torn into a comb by interlacing; deinterlaced, neighbouring lines agree."""
    frames = np.full((100, 96, 160, 3), 120, np.uint8)
    for index, frame in enumerate(frames):
        frame[:, 10 + index : 30 + index] = (230, 40, 40)
    options = {"x264-params": "tff=1:threads=1", "flags": "+ildct+ilme"}
    woven = interlaced(frames)
    encode(tmp_path / "clip.mts", woven, "libx264", options=options)
    shown = list(video_frames(tmp_path / "clip.mts"))
    assert len(shown) == len(woven)

    def comb(picture: np.ndarray) -> float:
        lines = picture[20:-20].astype(int)
        return float(np.abs(lines[1:-1] - (lines[:-2] + lines[2:]) / 2).mean())

    assert comb(shown[25]) < 0.3 * comb(woven[25])
