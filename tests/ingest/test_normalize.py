"""One raw clip: any container, rate and size becomes 80 even frames, or is refused with the reason."""

import os
import re
import resource
import struct
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest

from anyview.ingest.clips import ingest_clip
from anyview.ingest.normalize import Refused, read_clip
from anyview.video.files import read_video
from tests.ingest.raw_clips import LIMITS, candidate, damaged, pictures, refusal, shrunk, write_raw


@pytest.mark.parametrize(
    ("name", "codec", "width", "height", "fps"),
    [
        ("clip.avi", "XVID", 160, 90, 10.0),
        ("clip.avi", "MJPG", 128, 128, 12.5),
        ("clip.mp4", "mp4v", 320, 180, 29.97),
        ("clip.mov", "mp4v", 90, 160, 25.0),
        ("clip.mkv", "XVID", 200, 150, 15.0),
        ("clip.webm", "VP80", 96, 64, 20.0),
        ("clip.mpg", "PIM1", 160, 96, 25.0),
    ],
)
def test_any_container_codec_size_and_rate_becomes_the_right_frames(
    tmp_path, name, codec, width, height, fps
):
    frames = pictures(round(8.1 * fps), width, height)
    clip = read_clip(write_raw(tmp_path / name, frames, fps, codec), LIMITS)
    assert clip.shape == (80, 48, 48, 3)
    assert clip.dtype == np.uint8
    side = min(width, height)
    top, left = (height - side) // 2, (width - side) // 2
    for k in (0, 13, 40, 79):
        nearest = frames[round(k / 10 * fps)][top : top + side, left : left + side]
        assert np.abs(clip[k] - shrunk(nearest)).mean() < 6


def test_frames_are_resampled_by_the_sidecar_and_not_by_the_header(tmp_path):
    frames = pictures(120)
    times = np.cumsum(np.tile([0.05, 0.10, 0.0505], 40)) - 0.05
    path = write_raw(tmp_path / "clip.avi", frames, fps=25.0)
    pd.DataFrame({"seconds": times}).to_csv(tmp_path / "clip.times.csv", index=False)
    clip = read_clip(path, LIMITS)
    small = np.stack([shrunk(frame) for frame in frames])
    for k in (0, 10, 33, 79):
        chosen = np.argmin(np.abs(clip[k] - small).mean(axis=(1, 2, 3)))
        assert abs(times[chosen] - k / 10) <= 0.051


def test_a_webm_of_uneven_times_that_states_no_rate(tmp_path):
    """As a browser records: FFmpeg gives the clock's rate, 1000, and counts that many frames a second."""
    path = write_raw(tmp_path / "clip.webm", pictures(250), 30.0, "VP80")
    content = bytearray(path.read_bytes())
    blocks = re.finditer(
        rb"\xa3(?:[\x81-\xfe]|[\x40-\x7f].|[\x10-\x3f]..)\x81(..)[\x00\x80]", bytes(content), re.DOTALL
    )
    for index, block in enumerate(blocks):
        (time,) = struct.unpack(">h", block[1])
        struct.pack_into(">h", content, block.start(1), time + index * 7 % 13)
    assert index == 249
    rate = content.index(b"\x23\xe3\x83")  # DefaultDuration becomes an element of nothing
    length = 2 + content[rate + 3] % 128
    content[rate : rate + 2 + length] = bytes([0xEC, 0x80 | length]) + bytes(length)
    path.write_bytes(content)
    assert cv2.VideoCapture(str(path)).get(cv2.CAP_PROP_FPS) == 1000
    clip = read_clip(path, LIMITS)
    for k in (0, 40, 79):
        assert min(np.abs(clip[k] - shrunk(pictures(250)[3 * k + d])).mean() for d in (0, 1)) < 6
    longer = struct.unpack_from(">d", content, place := content.index(b"\x44\x89\x88") + 3)[0] * 1.2
    struct.pack_into(">d", content, place, longer)
    path.write_bytes(content)
    with pytest.raises(Refused, match="250 of 300 frames can be decoded"):
        read_clip(path, LIMITS)


@pytest.mark.parametrize("name", ["clip.mp4", "clip.mov"])
def test_a_clip_that_was_trimmed_without_being_written_anew_is_no_damaged_one(tmp_path, name):
    path = write_raw(tmp_path / name, pictures(300), 30.0, "mp4v")
    content = bytearray(path.read_bytes())
    entry = content.index(b"elst") + 12  # the edit list's only entry: milliseconds to show, where to begin
    length, begin = struct.unpack_from(">Ii", content, entry)
    assert (length, begin) == (10_000, 0)
    scale = struct.unpack_from(">I", content, content.index(b"mdhd") + 16)[0]
    struct.pack_into(">Ii", content, entry, 8300, round(1.5 * scale))
    path.write_bytes(content)
    clip = read_clip(path, LIMITS)
    for k in (0, 40, 79):
        assert np.abs(clip[k] - shrunk(pictures(300)[round(30 * (1.5 + k / 10))])).mean() < 6
    struct.pack_into(">I", content, entry - 4, 10**9)
    path.write_bytes(content)
    with pytest.raises(Refused, match="damaged: altered"):
        read_clip(path, LIMITS)


def test_a_codec_that_is_unknown_here_is_not_only_called_damage(tmp_path):
    path = write_raw(tmp_path / "clip.avi", pictures())
    path.write_bytes(path.read_bytes().replace(b"XVID", b"AV01"))
    with pytest.raises(Refused, match="codec that is unknown here: no frame"):
        read_clip(path, LIMITS)


REFUSALS = {
    "black": (lambda x: np.zeros_like(x), 10.0, "black or of one colour"),
    "grey": (
        lambda x: np.repeat(x.mean(axis=-1, keepdims=True).astype(np.uint8), 3, axis=-1),
        10.0,
        "without colour",
    ),
    "still": (lambda x: np.repeat(x[:1], len(x), axis=0), 10.0, "nothing moves"),
    "frozen": (lambda x: np.concatenate([x[:50], np.repeat(x[50:51], 32, axis=0)]), 10.0, "frozen for 2.9 s"),
    "short": (lambda x: x[:60], 10.0, "6.00 s long, 8 s are needed"),
    "slow": (lambda x: x[:41], 5.0, "slower than 10 frames a second"),
    "long": (lambda x: np.concatenate([x, x]), 10.0, "longer than 12 s"),
    "gap": (lambda x: x[:20], 2.0, "no frame between 0.00 s and 0.50 s"),
}


@pytest.mark.parametrize("name", REFUSALS)
def test_what_no_demonstration_looks_like_is_refused_with_the_reason(tmp_path, name):
    change, fps, reason = REFUSALS[name]
    path = write_raw(tmp_path / "clip.avi", change(pictures()), fps, "FFV1")
    with pytest.raises(Refused, match=reason):
        read_clip(path, LIMITS)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("seconds\n0\n0.1\n", "lists 2 frames"),
        ("seconds\n" + "\n".join(str(i / 10) for i in range(99)), "lists 99 frames"),
        ("seconds\n" + "\n".join(str(-i / 10) for i in range(82)), "do not increase"),
        ("seconds\n" + "nan\n" * 82, "do not increase"),
        ("seconds\n" + "soon\n" * 82, "not a table of seconds"),
        ("minutes\n0\n", "not a table of seconds"),
        ("", "not a table of seconds"),
    ],
)
def test_a_sidecar_that_does_not_fit_is_refused(tmp_path, content, reason):
    path = write_raw(tmp_path / "clip.avi", pictures())
    (tmp_path / "clip.times.csv").write_text(content)
    with pytest.raises(Refused, match=reason):
        read_clip(path, LIMITS)


def test_paths_that_leave_the_folder_or_are_no_clips_are_refused(tmp_path):
    raw, work = tmp_path / "raw", tmp_path / "work"
    write_raw(tmp_path / "outside.avi", pictures())
    raw.mkdir()
    (raw / "link.avi").symlink_to(tmp_path / "outside.avi")
    (raw / "loop.avi").symlink_to(raw / "loop.avi")
    (raw / "folder.avi").mkdir()
    (raw / "empty.avi").touch()
    os.mkfifo(raw / "pipe.avi")
    (raw / "text.avi").write_text("#EXTM3U\n#EXTINF:8,\n../outside.avi\n")
    (raw / "list.m3u8").write_text("#EXTM3U\n#EXTINF:8,\n../outside.avi\n#EXT-X-ENDLIST\n")
    (raw / "list.ffconcat").write_text("ffconcat version 1.0\nfile ../outside.avi\n")
    reasons = {
        "../outside.avi": "leaves the folder",
        str(tmp_path / "outside.avi"): "leaves the folder",
        "link.avi": "leaves the folder",
        "loop.avi": "path cannot be used|no such file",
        "folder.avi": "not a file",
        "pipe.avi": "not a file",
        "empty.avi": "an empty file",
        "absent.avi": "no such file",
        "nul\0.avi": "path cannot be used",
        "x" * 5000: "path cannot be used",
        "text.avi": "not a video",
        "list.m3u8": "not a video",
        "list.ffconcat": "not a video",
        "concat:text.avi": "no such file",
        "http://127.0.0.1:9/x.avi": "no such file",
    }
    for file, reason in reasons.items():
        assert re.search(reason, refusal(raw, file, work)), file
    assert "kind 'odd'" in ingest_clip(raw, work, candidate("text.avi", kind="odd"), LIMITS).reason


def test_a_file_above_the_stated_size_is_refused(tmp_path):
    path = write_raw(tmp_path / "clip.avi", pictures())
    small = LIMITS.model_copy(update={"max_megabytes": path.stat().st_size / 1e6 - 0.001})
    assert refusal(tmp_path, "clip.avi", tmp_path / "work", small).startswith("larger than")


@pytest.mark.parametrize(
    ("name", "codec", "sides", "claimed"),
    [
        ("clip.avi", "XVID", b"\x40\x01\0\0\xb4\0\0\0", b"\xa0\x86\1\0\xa0\x86\1\0"),  # 100,000 x 100,000
        ("clip.mkv", "XVID", b"\xb0\x82\x01\x40", b"\xb0\x82\xff\xff"),
        ("clip.mp4", "mp4v", b"\x01\x40\0\0\0\xb4\0\0", b"\xff\xff\0\0\xff\xff\0\0"),
    ],
)
def test_a_header_that_claims_a_giant_picture_is_refused(tmp_path, name, codec, sides, claimed):
    path = write_raw(tmp_path / name, pictures(width=320, height=180), codec=codec)
    content = path.read_bytes()
    assert sides in content
    path.write_bytes(content.replace(sides, claimed))
    assert "claims a picture of" in refusal(tmp_path, name, tmp_path / "work")


@pytest.mark.parametrize("side", [3000, 60_000])
def test_a_frame_that_claims_a_giant_picture_is_refused_without_the_memory(tmp_path, side):
    path = write_raw(tmp_path / "clip.avi", pictures(), codec="MJPG")
    start = b"\xff\xc0\x00\x11\x08"  # of a JPEG's frame header; height and width follow
    claimed = start + side.to_bytes(2, "big") * 2
    path.write_bytes(path.read_bytes().replace(start + b"\0\x5a\0\xa0", claimed))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert "damaged" in refusal(tmp_path, "clip.avi", tmp_path / "work")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200_000  # kilobytes


def test_a_clip_that_takes_forever_to_decode_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("anyview.ingest.normalize.PATIENCE", 0.0)
    with pytest.raises(Refused, match="to decode"):
        read_clip(write_raw(tmp_path / "clip.avi", pictures()), LIMITS)


@pytest.mark.parametrize(
    ("name", "codec", "count"), [("clip.avi", "XVID", 80), ("clip.mp4", "mp4v", 60), ("clip.mkv", "XVID", 60)]
)
def test_of_two_hundred_damaged_clips_only_sound_ones_pass(tmp_path, name, codec, count):
    """Structural damage is refused; what is accepted has 80 frames that decode and change."""
    content = write_raw(tmp_path / name, pictures(), codec=codec).read_bytes()
    accepted = 0
    renamed = {".avi": ".mp4", ".mp4": ".mkv", ".mkv": ".avi"}
    for index, (way, altered) in enumerate(damaged(content, count, seed=1)):
        suffix = Path(name).suffix
        file = f"{index:03d}{renamed[suffix] if way == 'renamed' else suffix}"
        (tmp_path / file).write_bytes(altered)
        reason = refusal(tmp_path, file, tmp_path / "work")
        if way in ("cut", "emptied", "other"):
            assert reason, f"{way} {index} was accepted"
        if not reason:
            accepted += 1
            frames = read_video(tmp_path / "work" / f"{index:03d}.avi")
            assert frames.shape == (80, 48, 48, 3)
            assert len({frame.tobytes() for frame in frames}) > 60
    assert 0 < accepted < 0.4 * count


def nested(name: str) -> bytes:
    """A container of thousands of containers in each other."""
    depth = 3000
    if name.endswith(".mp4"):
        boxes = b"".join(struct.pack(">I4s", 8 * (depth - level), b"moov") for level in range(depth))
        return struct.pack(">I4s4sI", 16, b"ftyp", b"isom", 0) + boxes
    lists = b"".join(
        struct.pack("<4sI4s", b"LIST", 12 * (depth - level) - 8, b"movi" if level == 0 else b"rec ")
        for level in range(depth)
    )
    return struct.pack("<4sI4s", b"RIFF", len(lists) + 4, b"AVI ") + lists


@pytest.mark.parametrize("name", ["clip.mp4", "clip.avi"])
def test_endless_nesting_is_refused(tmp_path, name):
    (tmp_path / name).write_bytes(nested(name))
    assert refusal(tmp_path, name, tmp_path / "out") == "damaged: nested too deeply"


def test_a_table_of_more_parts_than_a_clip_can_have_is_refused_unread(tmp_path):
    path = write_raw(tmp_path / "clip.mp4", pictures(), codec="mp4v")
    content = bytearray(path.read_bytes())
    struct.pack_into(">I", content, content.index(b"stsz") + 12, 200_001)
    path.write_bytes(content)
    with pytest.raises(Refused, match="damaged: too many parts"):
        read_clip(path, LIMITS)


def test_a_giant_sidecar_is_refused_unread(tmp_path):
    path = write_raw(tmp_path / "clip.avi", pictures())
    (tmp_path / "clip.times.csv").write_text("seconds\n" + "0.1\n" * 300_000)
    with pytest.raises(Refused, match="too large for a clip's times"):
        read_clip(path, LIMITS)


def test_a_sidecar_of_giant_numbers_is_refused(tmp_path):
    write_raw(tmp_path / "clip.avi", pictures())
    (tmp_path / "clip.times.csv").write_text("seconds\n" + "9" * 400 + "\n" + "9" * 401 + "\n")
    assert "clip.times.csv: " in refusal(tmp_path, "clip.avi", tmp_path / "out")


def test_a_clip_that_mostly_stands_still_is_refused(tmp_path):
    write_raw(tmp_path / "clip.avi", np.repeat(pictures()[::8], 8, axis=0), codec="FFV1")
    assert refusal(tmp_path, "clip.avi", tmp_path / "out").startswith("frozen: ")


def test_a_transport_stream_that_was_cut_is_refused(tmp_path):
    path = write_raw(tmp_path / "clip.ts", pictures(100), codec="mp4v")
    assert refusal(tmp_path, "clip.ts", tmp_path / "whole") == ""
    content = path.read_bytes()
    path.write_bytes(content[: len(content) * 19 // 20 // 188 * 188 + 1])
    assert refusal(tmp_path, "clip.ts", tmp_path / "out") == "damaged: cut short"
