"""Sets of clips of equal length, kept as video files and read as one memory map.

A set is a folder with video files, each holding one or more clips end to end, and two tables:

- ``files.csv``: ``file, clips, frames, sha256``, a row for each video file (``frames``: of one clip);
- ``manifest.csv``: a row for each clip, in the order of the files, whose column ``clip`` is the clip's id.

To make one, call ``write_clips`` or ``write_shard`` for each file, from parallel workers if you like, and
``write_set`` with what they returned at the end.
"""

import errno
import math
import os
import socket
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from itertools import islice
from pathlib import Path

import numpy as np
import pandas as pd
import psutil

from anyview.runtime.device import worker_count
from anyview.runtime.errors import AnyviewError
from anyview.runtime.once import sha256
from anyview.runtime.outputs import write_atomically
from anyview.runtime.scratch import content_key, scratch_folder
from anyview.video.files import Codec, video_frames, write_video
from anyview.video.manifests import read_table
from anyview.video.reading import open_video

_LAYOUT = "frames-1"  # of the decoded file; part of its key


@dataclass(frozen=True)
class StoredFile:
    """A row of ``files.csv``."""

    file: str
    clips: int
    frames: int
    sha256: str


@dataclass(frozen=True)
class FrameStore:
    """A decoded set: ``frames`` is a read-only map, uint8 RGB (N, T, H, W, 3); manifest row n is clip n."""

    frames: np.ndarray
    manifest: pd.DataFrame


def stored_file(path: Path, clips: int, frames: int) -> StoredFile:
    """The row of ``files.csv`` for a file of ``clips`` clips of ``frames`` frames each."""
    return StoredFile(path.name, clips, frames, sha256(path))


def write_clips(path: Path, clips: np.ndarray, rate: float, codec: Codec = "FFV1") -> StoredFile:
    """Write clips, uint8 RGB (n, T, H, W, 3), end to end into one file; returns its row of ``files.csv``."""
    count, length, *picture = clips.shape
    write_video(path, clips.reshape(count * length, *picture), rate, codec)
    return stored_file(path, count, length)


def write_shard(folder: Path, index: int, clips: np.ndarray, rate: float = 10.0) -> StoredFile:
    """Write shard number ``index`` of a simulated set, losslessly: ``write_clips`` to ``shard-0000.avi``."""
    return write_clips(folder / f"shard-{index:04d}.avi", clips, rate)


def write_set(folder: Path, manifest: pd.DataFrame, files: Sequence[StoredFile]) -> None:
    """Write ``manifest.csv`` (a row for each clip, in the order of ``files``) and ``files.csv``."""
    if len(manifest) != sum(stored.clips for stored in files):
        raise ValueError(f"{len(manifest)} manifest rows for {sum(stored.clips for stored in files)} clips")
    rows = pd.DataFrame([asdict(stored) for stored in files], columns=list(StoredFile.__dataclass_fields__))
    write_atomically(folder / "files.csv", rows.to_csv(index=False))
    write_atomically(folder / "manifest.csv", manifest.to_csv(index=False))


def open_frames(folder: Path) -> FrameStore:
    """Open a set of clips, decoded once per machine into the scratch folder.

    Every file is checked against its SHA-256 on every call. Raises AnyviewError naming the first file that is
    missing, cut short or altered. Little is in memory: frames go to disk one by one.
    """
    manifest = read_table(folder / "manifest.csv", ["clip"], unique="clip")
    files = _read_files(folder)
    if len(manifest) != sum(stored.clips for stored in files):
        raise AnyviewError(
            f"{folder / 'manifest.csv'}: it lists {len(manifest)} clips, files.csv other numbers"
        )
    for stored in files:
        _check(folder, stored)
    key = content_key(_LAYOUT, [folder / "manifest.csv", folder / "files.csv"])
    decoded = scratch_folder("frames", key) / "frames.npy"
    frames = _map(decoded)
    if frames is None:
        _decode(folder, files, decoded)
        frames = _map(decoded)
    assert frames is not None
    return FrameStore(frames, manifest)


def read_stored(folder: Path, clip: str) -> tuple[np.ndarray, float]:
    """Frames, uint8 RGB (T, H, W, 3), and frames per second of one clip: its file alone is read, and checked.

    Raises AnyviewError if the set has no such clip, or its file is missing or altered.
    """
    manifest = read_table(folder / "manifest.csv", ["clip"], unique="clip")
    rows = np.flatnonzero(manifest["clip"] == clip)
    if not len(rows):
        raise AnyviewError(f"{folder / 'manifest.csv'}: it lists no clip {clip}")
    place = int(rows[0])
    for stored in _read_files(folder):
        if place < stored.clips:
            _check(folder, stored)
            with open_video(folder / stored.file) as video:
                wanted = islice(video.frames(), place * stored.frames, (place + 1) * stored.frames)
                frames = [video.rgb(frame) for frame in wanted]
            if len(frames) < stored.frames:
                raise AnyviewError(f"{folder / stored.file}: fewer frames than files.csv says")
            return np.stack(frames), video.rate
        place -= stored.clips
    raise AnyviewError(f"{folder / 'manifest.csv'}: it lists more clips than files.csv")


def _read_files(folder: Path) -> list[StoredFile]:
    path = folder / "files.csv"
    table = read_table(path, list(StoredFile.__dataclass_fields__), unique="file")
    files = []
    for row in table.to_dict("records"):
        counts = pd.to_numeric(pd.Series([row["clips"], row["frames"]]), errors="coerce")
        if Path(row["file"]).name != row["file"] or not (counts % 1 == 0).all() or (counts < 1).any():
            raise AnyviewError(f"{path}: impossible row for {row['file']!r}")
        files.append(StoredFile(row["file"], int(counts[0]), int(counts[1]), row["sha256"]))
    if not files:
        raise AnyviewError(f"{path}: it lists no clips")
    if len({stored.frames for stored in files}) > 1:
        raise AnyviewError(f"{path}: clips of different lengths")
    return files


def _check(folder: Path, stored: StoredFile) -> None:
    path = folder / stored.file
    if not path.is_file():
        raise AnyviewError(f"{path}: missing; run `dvc checkout` or the stage that makes it")
    if sha256(path) != stored.sha256:
        raise AnyviewError(f"{path}: cut short or altered since it was written; run `dvc checkout --force`")


def _map(path: Path) -> np.ndarray | None:
    try:
        return np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError):  # absent, or cut short by a machine that died
        return None


def _decode(folder: Path, files: list[StoredFile], target: Path) -> None:
    """Decode ``files`` into ``target``, a ``.npy`` of shape (N, T, H, W, 3) that appears when it is whole."""
    _remove_partials_of_the_dead(target)
    picture = next(video_frames(folder / files[0].file)).shape
    shape = (sum(stored.clips for stored in files), files[0].frames, *picture)
    starts = np.cumsum([0, *(stored.clips * stored.frames for stored in files)]) * math.prod(picture)
    partial = target.with_name(f"{_partials_of_this_machine()}{os.getpid()}")
    try:
        with partial.open("wb") as handle:
            header = {"descr": "|u1", "fortran_order": False, "shape": shape}
            np.lib.format.write_array_header_1_0(handle, header)
            begin = handle.tell()
            handle.truncate(begin + math.prod(shape))

            # Plain writes: pages written through a memory map would count as resident until they are flushed.
            def decode(stored: StoredFile, offset: int) -> None:
                count = 0
                for frame in video_frames(folder / stored.file):
                    if frame.shape != picture:
                        raise AnyviewError(f"{folder / stored.file}: frames {frame.shape}, not {picture}")
                    place = begin + offset + count * frame.nbytes
                    if os.pwrite(handle.fileno(), frame.data, place) != frame.nbytes:
                        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(target))
                    count += 1
                if count != stored.clips * stored.frames:
                    expected = f"{stored.clips} x {stored.frames}"
                    raise AnyviewError(f"{folder / stored.file}: {count} frames, not {expected}")

            with ThreadPoolExecutor(worker_count()) as pool:  # OpenCV decodes outside the interpreter's lock
                for _ in pool.map(decode, files, (int(start) for start in starts[:-1])):
                    pass
        os.replace(partial, target)
    finally:
        partial.unlink(missing_ok=True)


def _partials_of_this_machine() -> str:
    """What their names begin with: others may share the folder, and have processes of the same numbers."""
    return f"partial-{socket.gethostname()}-"


def _remove_partials_of_the_dead(target: Path) -> None:
    ours = _partials_of_this_machine()
    for partial in target.parent.glob("partial-*"):
        if not partial.name.startswith(ours):
            continue
        pid = partial.name.removeprefix(ours)
        if not (pid.isdigit() and psutil.pid_exists(int(pid))):
            partial.unlink(missing_ok=True)
