"""Episodes of a LeRobotDataset as rows of a raw manifest: its videos stay where they are."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from pydantic import BaseModel, ValidationError

from anyview.lerobot.layout import CAMERAS, EPISODES, INFO, PART, VERSION, VIDEOS, place_in_file, read_numbers
from anyview.runtime.errors import AnyviewError
from anyview.video.manifests import KINDS, RAW_COLUMNS, STRETCH_COLUMNS

_LARGEST = 1e6  # number of an episode or a file, and seconds of a file


class _Feature(BaseModel):
    dtype: str


class _Info(BaseModel):
    codebase_version: str
    features: dict[str, _Feature]
    video_path: str | None = None


def episode_views(folder: Path, cameras: Sequence[str]) -> pd.DataFrame:
    """A row of a raw manifest, with start and end, for each episode and camera; files relative to ``folder``.

    ``cameras`` are names of features, such as ``observation.images.top``. What several of them saw of one
    episode has one ``pair``. Raises AnyviewError if the folder holds no data set of version 3, if a camera is
    not in it, if a table is damaged or holds impossible numbers, or if a video file is missing.
    """
    _check_cameras(folder, cameras)
    numbers = _read_episodes(folder, cameras)
    rows = []
    for numbered in numbers.to_dict("records"):
        episode = int(numbered["episode_index"])
        for camera in cameras:
            chunk, file, start, end = (numbered[column] for column in place_in_file(camera))
            if not start < end:
                raise AnyviewError(
                    f"{folder}: episode {episode} of {camera} starts at {start:g} s and ends at {end:g} s"
                )
            name = VIDEOS.format(video_key=camera, chunk_index=int(chunk), file_index=int(file))
            pair = f"{folder.resolve().name}-{episode:06d}"
            times = (f"{seconds:.10g}" for seconds in (start, end))
            rows.append((name, pair, camera.removeprefix(CAMERAS), KINDS[0], *times))
    table = pd.DataFrame(rows, columns=[*RAW_COLUMNS, *STRETCH_COLUMNS])
    for name in table["file"].unique():
        if not (folder / name).is_file():
            raise AnyviewError(f"{folder / name}: no such file; download the data set with its videos")
    return table


def _check_cameras(folder: Path, cameras: Sequence[str]) -> None:
    path = folder / INFO
    try:
        info = _Info.model_validate_json(path.read_bytes())
    except (FileNotFoundError, NotADirectoryError):
        raise AnyviewError(f"{folder}: not a LeRobot data set: it has no {INFO}") from None
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"]))
        raise AnyviewError(f"{path}: {key + ': ' if key else ''}{first['msg']}") from None
    if not info.codebase_version.startswith("v3."):
        raise AnyviewError(
            f"{path}: version {info.codebase_version}, not {VERSION}; convert it by `python -m "
            "lerobot.scripts.convert_dataset_v21_to_v30 --repo-id=NAME --root=FOLDER --push-to-hub=false`"
        )
    filmed = [name for name, feature in info.features.items() if feature.dtype == "video"]
    choice = f"its cameras with video: {', '.join(filmed) or 'none'}"
    if not cameras:
        raise AnyviewError(f"{folder}: say which --camera; {choice}")
    for camera in cameras:
        if camera not in info.features:
            raise AnyviewError(f"{folder}: no camera {camera}; {choice}")
        if camera not in filmed:
            dtype = info.features[camera].dtype
            raise AnyviewError(f"{folder}: {camera} is kept as {dtype}, not as video; {choice}")
    if info.video_path != VIDEOS:
        raise AnyviewError(f"{path}: video_path is {info.video_path!r}, in {VERSION} it is {VIDEOS!r}")


def _read_episodes(folder: Path, cameras: Sequence[str]) -> pd.DataFrame:
    """Number of each episode and its place in the cameras' files, all of them possible."""
    whole = [column for camera in cameras for column in place_in_file(camera)]
    pattern = EPISODES.replace(PART, "*/*")
    paths = sorted(folder.glob(pattern))
    if not paths:
        raise AnyviewError(f"{folder}: no episode tables ({pattern}); download the data set whole")
    table = pd.concat([read_numbers(path, ["episode_index", *whole]) for path in paths])
    numbers = table.astype(float)
    counts = [column for column in table.columns if column.endswith("_index")]
    possible = numbers.ge(0) & numbers.le(_LARGEST)
    possible[counts] &= numbers[counts] % 1 == 0
    wrong = np.argwhere(~possible.to_numpy())
    if len(wrong):
        row, column = wrong[0]
        value = numbers.iat[row, column]
        raise AnyviewError(f"{folder}: row {row + 1} of its episodes: {table.columns[column]} is {value:g}")
    repeated = numbers["episode_index"][numbers["episode_index"].duplicated()]
    if len(repeated):
        raise AnyviewError(f"{folder}: episode {repeated.iloc[0]:g} is listed twice")
    if numbers.empty:
        raise AnyviewError(f"{folder}: it has no episodes")
    return numbers.sort_values("episode_index")
