"""Raw clips as other programs leave them, ways to damage them, and what ingest says of one."""

from collections.abc import Iterator
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from anyview.config import Ingest
from anyview.ingest.clips import Candidate, ingest_clip
from anyview.seeds import stream

LIMITS = Ingest(size=48, frames=80, rate=10.0, max_megabytes=50.0, even_exposure=False)


@cache
def pictures(count: int = 82, width: int = 160, height: int = 90, seed: int = 0) -> np.ndarray:
    """A clip (count, H, W, 3), uint8 RGB: a blue disc moves to a red square over a grainy table."""
    rng = stream(seed, "raw clip")
    table = rng.normal((150, 130, 100), 10, (height, width, 3))
    frames = np.empty((count, height, width, 3), np.uint8)
    size, middle = height // 10, height // 2
    goal = int(width * rng.uniform(0.55, 0.65))
    for index in range(count):
        frame = np.clip(table + rng.normal(0, 2, table.shape), 0, 255).astype(np.uint8)
        cv2.rectangle(frame, (goal - size, middle - size), (goal + size, middle + size), (190, 30, 30), -1)
        x = width * 0.3 + (goal - width * 0.3) * index / count
        cv2.circle(frame, (int(x), middle), size, (25, 50, 150), -1)
        frames[index] = frame
    return frames


def write_raw(path: Path, frames: np.ndarray, fps: float = 10.0, codec: str = "XVID") -> Path:
    """Write a clip with OpenCV alone."""
    path.parent.mkdir(parents=True, exist_ok=True)
    height, width = frames.shape[1:3]
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*codec), fps, (width, height))
    assert writer.isOpened()
    for frame in frames:
        writer.write(cv2.cvtColor(frame, cv2.COLOR_RGB2BGR))
    writer.release()
    return path


def shrunk(frame: np.ndarray) -> np.ndarray:
    """The middle square at 48 x 48: enlarged to a multiple of that, then the mean of each block."""
    height, width = frame.shape[:2]
    left = (width - height) // 2
    square = cv2.resize(frame[:, left : left + height], (48 * 15, 48 * 15), interpolation=cv2.INTER_NEAREST)
    return square.reshape(48, 15, 48, 15, 3).mean(axis=(1, 3))


def damaged(content: bytes, count: int, seed: int) -> Iterator[tuple[str, bytes]]:
    """``count`` damaged versions of a file, each with what was done to it ("renamed": to you)."""
    rng = stream(seed, "damage")
    header = 6000 if len(content) > 12000 else len(content) // 2
    ways = (
        "cut",
        "header",
        "payload",
        "hole",
        "cut",
        "moved",
        "header",
        "longer",
        "emptied",
        "other",
        "renamed",
    )
    for index in range(count):
        way = ways[index % len(ways)]
        if way == "cut":
            yield way, content[: int(rng.integers(1, len(content)))]
        elif way == "renamed":
            yield way, content
        elif way == "emptied":
            yield way, b""
        elif way == "other":
            yield way, rng.bytes(int(rng.integers(1, 5000)))
        elif way == "longer":
            yield way, content + rng.bytes(int(rng.integers(1, 5000)))
        else:
            altered = bytearray(content)
            if way == "header":
                for at in rng.integers(0, header, int(rng.integers(1, 5))):
                    altered[at] = int(rng.integers(256))
            elif way == "payload":
                for at in rng.integers(header, len(content), int(rng.integers(1, 30))):
                    altered[at] ^= int(rng.integers(1, 256))
            else:
                length = int(rng.integers(1, len(content) // 4))
                at, other = (int(place) for place in rng.integers(0, len(content) - length, 2))
                altered[at : at + length] = (
                    bytes(length) if way == "hole" else content[other : other + length]
                )
            yield way, bytes(altered)


def candidate(file: str, pair: str = "", kind: str = "standard") -> Candidate:
    return Candidate(Path(file).stem, file, pair or Path(file).stem, "", kind)


def refusal(source: Path, file: str, folder: Path, limits=LIMITS) -> str:
    folder.mkdir(exist_ok=True)
    return ingest_clip(source, folder, candidate(file), limits).reason
