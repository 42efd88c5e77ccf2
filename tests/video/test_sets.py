"""Video files and decoded sets: lossless, whole, and clear about damage."""

import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anyview.runtime.errors import AnyviewError
from anyview.seeds import stream
from anyview.video.files import read_video, write_video
from anyview.video.sets import open_frames, read_stored, write_set, write_shard


def noise(*shape: int) -> np.ndarray:
    return stream(0, "test", *shape).integers(0, 256, shape, dtype=np.uint8)


def make_set(folder: Path, shards: int = 3) -> np.ndarray:
    folder.mkdir()
    clips = noise(shards * 2, 5, 32, 48, 3)
    files = [write_shard(folder, i, clips[2 * i : 2 * i + 2]) for i in range(shards)]
    write_set(folder, pd.DataFrame({"clip": [f"{i:03d}" for i in range(len(clips))]}), files)
    return clips


@settings(max_examples=15)
@given(
    count=st.integers(1, 9),
    height=st.integers(4, 35),
    width=st.integers(4, 35),
    rate=st.sampled_from([10.0, 29.97]),
)
def test_ffv1_is_lossless_in_rgb_at_any_even_size(tmp_path_factory, count, height, width, rate):
    path = tmp_path_factory.mktemp("video") / "clip.avi"
    frames = noise(count, 2 * height, 2 * width, 3)
    write_video(path, frames, rate, "FFV1")
    np.testing.assert_array_equal(read_video(path), frames)


def test_xvid_is_close_and_keeps_the_channel_order(tmp_path):
    frames = np.zeros((10, 48, 48, 3), np.uint8)
    frames[..., 0] = 200  # red
    write_video(tmp_path / "red.avi", frames, 10.0, "XVID")
    assert np.abs(read_video(tmp_path / "red.avi").astype(int) - frames).mean() < 6


def test_a_set_reads_back_in_manifest_order_and_read_only(tmp_path):
    clips = make_set(tmp_path / "set")
    store = open_frames(tmp_path / "set")
    np.testing.assert_array_equal(store.frames, clips)
    assert list(store.manifest["clip"]) == ["000", "001", "002", "003", "004", "005"]
    with pytest.raises(ValueError, match="read-only"):
        store.frames[0] = 0


def test_a_clip_alone_is_read_from_its_own_file(tmp_path):
    clips = make_set(tmp_path / "set")
    (tmp_path / "set/shard-0000.avi").unlink()
    for index in range(2, 6):
        frames, rate = read_stored(tmp_path / "set", f"{index:03d}")
        np.testing.assert_array_equal(frames, clips[index])
        assert rate == 10.0
    for clip, complaint in (
        ("000", "shard-0000.avi: missing"),
        ("006", "manifest.csv: it lists no clip 006"),
    ):
        with pytest.raises(AnyviewError, match=complaint):
            read_stored(tmp_path / "set", clip)
    with (tmp_path / "set/shard-0001.avi").open("ab") as file:
        file.write(b"more")
    with pytest.raises(AnyviewError, match=r"shard-0001\.avi: cut short or altered"):
        read_stored(tmp_path / "set", "002")


def test_one_or_two_workers_decode_the_same_bytes(tmp_path, monkeypatch):
    make_set(tmp_path / "set")
    decoded = []
    for workers in ("1", "2"):
        monkeypatch.setenv("ANYVIEW_WORKERS", workers)
        monkeypatch.setenv("ANYVIEW_SCRATCH", str(tmp_path / workers))
        open_frames(tmp_path / "set")
        decoded.append(next((tmp_path / workers).rglob("frames.npy")).read_bytes())
    assert decoded[0] == decoded[1]


def test_a_decoded_file_that_was_cut_short_is_made_again(tmp_path, scratch):
    clips = make_set(tmp_path / "set")
    open_frames(tmp_path / "set")
    decoded = next(scratch.rglob("frames.npy"))
    decoded.write_bytes(decoded.read_bytes()[:-1000])
    np.testing.assert_array_equal(open_frames(tmp_path / "set").frames, clips)


def test_half_decoded_files_go_with_their_process_unless_another_machine_is_at_work(tmp_path, scratch):
    make_set(tmp_path / "set")
    open_frames(tmp_path / "set")
    decoded = next(scratch.rglob("frames.npy"))
    decoded.unlink()
    dead = subprocess.Popen(["true"])
    dead.wait()
    ours, theirs = (
        decoded.with_name(f"partial-{host}-{dead.pid}") for host in (socket.gethostname(), "other")
    )
    for partial in (ours, theirs):
        partial.touch()
    open_frames(tmp_path / "set")
    assert theirs.exists()
    assert not ours.exists()


@pytest.mark.parametrize("damage", ["missing", "truncated", "altered"])
@pytest.mark.parametrize("decoded_before", [False, True])
def test_a_damaged_shard_is_named(tmp_path, damage, decoded_before):
    make_set(tmp_path / "set")
    if decoded_before:
        open_frames(tmp_path / "set")
    shard = tmp_path / "set" / "shard-0001.avi"
    content = bytearray(shard.read_bytes())
    if damage == "missing":
        shard.unlink()
    elif damage == "truncated":
        shard.write_bytes(content[: len(content) // 2])
    else:
        content[len(content) // 2] ^= 1
        shard.write_bytes(content)
    with pytest.raises(AnyviewError, match=r"shard-0001\.avi"):
        open_frames(tmp_path / "set")


@pytest.mark.parametrize(
    ("table", "content"),
    [
        ("manifest.csv", "clip\n001\n001\n"),
        ("manifest.csv", "name\n001\n"),
        ("manifest.csv", ""),
        ("manifest.csv", "clip\n001\n"),
        ("files.csv", "file,clips,frames,sha256\n../x.avi,2,5,0\n"),
        ("files.csv", "file,clips,frames,sha256\nshard-0000.avi,two,5,0\n"),
        ("files.csv", "file,clips,frames,sha256\nshard-0000.avi,-2,5,0\n"),
        ("files.csv", "file,clips,frames,sha256\n"),
        ("files.csv", '"\x00\xff'),
    ],
)
def test_an_impossible_table_is_named(tmp_path, table, content):
    make_set(tmp_path / "set")
    (tmp_path / "set" / table).write_bytes(content.encode("latin-1"))
    with pytest.raises(AnyviewError, match=r"(manifest|files)\.csv"):
        open_frames(tmp_path / "set")


WRITE_UNDER_LIMITS = """
import resource, signal, sys
from pathlib import Path
import numpy as np
from anyview.video.files import write_video
from anyview.runtime.errors import AnyviewError

signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
whole, path, codec = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3]
frames = np.random.default_rng(0).integers(0, 256, (20, 12, 12, 3), np.uint8).repeat(4, 1).repeat(4, 2)
write_video(whole, frames, 10.0, codec)
size = whole.stat().st_size
refused = 0
for limit in [*range(1000, size, size // 20), size - 1]:
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    try:
        write_video(path, frames, 10.0, codec)
    except AnyviewError:
        refused += 1
        assert not path.exists()
    else:  # FFmpeg's buffer may have taken less room for a moment
        assert path.read_bytes() == whole.read_bytes(), f"cut short at {limit} of {size} bytes"
print(refused)
"""


@pytest.mark.parametrize("codec", ["XVID", "FFV1"])
def test_a_full_disk_at_any_byte_leaves_no_half_video(tmp_path, codec):
    """A file size limit stands for a full disk: a write stores half of what it was given."""
    command = [sys.executable, "-c", WRITE_UNDER_LIMITS, tmp_path / "whole.avi", tmp_path / "clip.avi", codec]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) >= 20
    assert [path.name for path in tmp_path.iterdir()] == ["whole.avi"]


def test_a_write_that_fails_leaves_nothing(tmp_path):
    with pytest.raises(AnyviewError, match="nowhere"):
        write_video(tmp_path / "nowhere" / "clip.avi", noise(3, 16, 16, 3), 10.0)
    with pytest.raises(ValueError, match="uint8"):
        write_video(tmp_path / "clip.avi", noise(3, 16, 16, 3).astype(np.float32), 10.0)
    with pytest.raises(ValueError, match="even"):
        write_video(tmp_path / "clip.avi", noise(3, 16, 17, 3), 10.0)
    assert list(tmp_path.iterdir()) == []
