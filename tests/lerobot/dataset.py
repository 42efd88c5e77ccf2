"""A small LeRobotDataset v3.0, written by its documented layout: no code of ours makes it."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as arrow
import pyarrow.parquet as parquet

from tests.ingest.formats import encode
from tests.ingest.raw_clips import pictures

FPS = 12.0
TOP, SIDE = "observation.images.top", "observation.images.side"
LENGTHS = (36, 60, 30)  # frames of the episodes; two lie in the first file, one in the second
FILES = ((0, 1), (2,))


def episode(index: int, camera: str) -> np.ndarray:
    """What a camera saw of an episode, uint8 RGB (T, 90, 160, 3)."""
    return pictures(LENGTHS[index], seed=10 * index + (camera == SIDE))


def info() -> dict[str, Any]:
    picture = {"shape": [90, 160, 3], "names": ["height", "width", "channels"]}
    return {
        "codebase_version": "v3.0",
        "robot_type": "so101",
        "fps": int(FPS),
        "video_path": "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4",
        "features": {
            TOP: picture | {"dtype": "video"},
            SIDE: picture | {"dtype": "video"},
            "observation.images.wrist": picture | {"dtype": "image"},
            "action": {"dtype": "float32", "shape": [6], "names": None},
        },
    }


def episodes() -> dict[str, list[Any]]:
    """The columns of the episode table."""
    table: dict[str, list[Any]] = {
        "episode_index": [0, 1, 2],
        "tasks": [["push"]] * 3,
        "length": list(LENGTHS),
    }
    for camera in (TOP, SIDE):
        table |= {
            f"videos/{camera}/chunk_index": [0, 0, 0],
            f"videos/{camera}/file_index": [0, 0, 1],
            f"videos/{camera}/from_timestamp": [0.0, 3.0, 0.0],
            f"videos/{camera}/to_timestamp": [3.0, 8.0, 2.5],
        }
    return table


def write_info(folder: Path, content: Any) -> None:
    (folder / "meta").mkdir(parents=True, exist_ok=True)
    (folder / "meta" / "info.json").write_text(json.dumps(content))


def write_episodes(folder: Path, table: dict[str, list[Any]], number: int = 0) -> Path:
    path = folder / "meta" / "episodes" / "chunk-000" / f"file-{number:03d}.parquet"
    path.parent.mkdir(parents=True, exist_ok=True)
    parquet.write_table(arrow.table(table), path)
    return path


def write_dataset(folder: Path) -> None:
    write_info(folder, info())
    write_episodes(folder, episodes())
    for camera in (TOP, SIDE):
        for number, held in enumerate(FILES):
            path = folder / "videos" / camera / "chunk-000" / f"file-{number:03d}.mp4"
            path.parent.mkdir(parents=True, exist_ok=True)
            frames = np.concatenate([episode(index, camera) for index in held])
            encode(path, frames, "libsvtav1", FPS, options={"g": "2", "crf": "30", "preset": "12"})
