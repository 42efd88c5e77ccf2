"""Clips as a LeRobotDataset of videos alone: neither states nor actions, which no set of clips has."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from anyview.lerobot.layout import (
    CAMERAS,
    DATA,
    EPISODES,
    INFO,
    STATISTICS,
    TASKS,
    VERSION,
    VIDEOS,
    place_in_file,
    write_table,
)
from anyview.runtime.outputs import write_atomically
from anyview.video.files import VideoWriter

_CHUNK = 1000  # files in a folder
_QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}


def write_dataset(
    folder: Path,
    frames: np.ndarray,
    episodes: np.ndarray,
    cameras: Sequence[str],
    rate: float,
    task: str,
    written: Callable[[], None] = lambda: None,
    episodes_per_file: int = 500,
) -> None:
    """Write a data set into the empty ``folder``: ``frames`` uint8 RGB (N, T, H, W, 3), ``rate`` a second.

    Clip ``episodes[e, c]``, int (E, C), is what the camera ``cameras[c]`` saw of episode e. ``task`` says in
    words what is shown. ``written`` is called after each clip.
    """
    count, (length, height, width) = len(episodes), frames.shape[1:4]
    number = np.arange(count)
    file = number // episodes_per_file
    table = pd.DataFrame(
        {
            "episode_index": number,
            "tasks": [[task]] * count,
            "length": length,
            "data/chunk_index": 0,
            "data/file_index": 0,
            "dataset_from_index": number * length,
            "dataset_to_index": (number + 1) * length,
            "meta/episodes/chunk_index": 0,
            "meta/episodes/file_index": 0,
        }
    )
    statistics: dict[str, Any] = {}
    features: dict[str, Any] = {}
    for camera, clips in zip(cameras, episodes.T, strict=True):
        key = f"{CAMERAS}{camera}"
        histograms = np.zeros((3, 256), np.int64)
        for index in range(file[-1] + 1):
            path = folder / VIDEOS.format(
                video_key=key, chunk_index=index // _CHUNK, file_index=index % _CHUNK
            )
            path.parent.mkdir(parents=True, exist_ok=True)
            with VideoWriter(path, (width, height), rate, "AV1") as video:
                for clip in clips[file == index]:
                    for frame in frames[clip]:
                        video.write(frame)
                    histograms += [
                        np.bincount(plane.ravel(), minlength=256)
                        for plane in np.moveaxis(frames[clip], -1, 0)
                    ]
                    written()
        begin = number % episodes_per_file * length / rate
        place = (file // _CHUNK, file % _CHUNK, begin, begin + length / rate)
        table = table.assign(**dict(zip(place_in_file(key), place, strict=True)))
        statistics[key] = _statistics_of_pictures(histograms) | {"count": [count * length]}
        features[key] = {
            "dtype": "video",
            "shape": [height, width, 3],
            "names": ["height", "width", "channels"],
            "info": {
                "video.height": height,
                "video.width": width,
                "video.channels": 3,
                "video.codec": "av1",
                "video.pix_fmt": "yuv420p",
                "video.fps": _plain(rate),
                "has_audio": False,
            },
        }
    rows = _rows_of_frames(count, length, rate)
    for column in rows.columns:
        statistics[column] = _statistics(rows[column].to_numpy(float))
        features[column] = {"dtype": str(rows[column].dtype), "shape": [1], "names": None}
    info = {
        "codebase_version": VERSION,
        "robot_type": None,
        "total_episodes": count,
        "total_frames": count * length,
        "total_tasks": 1,
        "chunks_size": _CHUNK,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": _plain(rate),
        "splits": {"train": f"0:{count}"},
        "data_path": DATA,
        "video_path": VIDEOS,
        "features": features,
    }
    write_table(folder / DATA.format(chunk_index=0, file_index=0), rows)
    write_table(folder / EPISODES.format(chunk_index=0, file_index=0), table)
    write_table(
        folder / TASKS, pd.DataFrame({"task_index": [0]}, index=pd.Index([task], name="task")), index=True
    )
    write_atomically(folder / STATISTICS, json.dumps(statistics, indent=1) + "\n")
    write_atomically(folder / INFO, json.dumps(info, indent=1) + "\n")


def _plain(rate: float) -> float:
    return int(rate) if rate == int(rate) else rate


def _rows_of_frames(count: int, length: int, rate: float) -> pd.DataFrame:
    """A row for each frame of ``count`` episodes."""
    index = np.arange(count * length)
    return pd.DataFrame(
        {
            "timestamp": (index % length / rate).astype(np.float32),
            "frame_index": index % length,
            "episode_index": index // length,
            "index": index,
            "task_index": np.zeros_like(index),
        }
    )


def _statistics(values: np.ndarray) -> dict[str, list[float]]:
    """Of one column (n,)."""
    moments = {"min": values.min(), "max": values.max(), "mean": values.mean(), "std": values.std()}
    quantiles = {name: np.quantile(values, share) for name, share in _QUANTILES.items()}
    return {name: [float(value)] for name, value in (moments | quantiles).items()} | {"count": [len(values)]}


def _statistics_of_pictures(histograms: np.ndarray) -> dict[str, list[Any]]:
    """Of red, green and blue from 0 to 1, each (3, 1, 1), out of how often each level occurs (3, 256)."""
    levels = np.arange(256) / 255
    reached = histograms.cumsum(axis=1)
    total = reached[:, -1:]
    mean = histograms @ levels / total[:, 0]
    deviation = np.sqrt(np.maximum(histograms @ levels**2 / total[:, 0] - mean**2, 0))
    present = [levels[counts > 0] for counts in histograms]
    found = {
        "min": np.array([each.min() for each in present]),
        "max": np.array([each.max() for each in present]),
        "mean": mean,
        "std": deviation,
    } | {name: levels[(reached < share * total).sum(axis=1)] for name, share in _QUANTILES.items()}
    return {name: value.reshape(3, 1, 1).tolist() for name, value in found.items()}
