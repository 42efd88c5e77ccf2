"""Where a LeRobotDataset v3.0 keeps what, and its Parquet tables.

Source: huggingface.co/docs/lerobot/lerobot-dataset-v3. One MP4 holds many episodes; the episode tables tell
where in which file each of them is.
"""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd
import pyarrow as arrow
import pyarrow.parquet as parquet

from anyview.runtime.errors import AnyviewError

VERSION = "v3.0"
INFO = "meta/info.json"
STATISTICS = "meta/stats.json"
TASKS = "meta/tasks.parquet"
PART = "chunk-{chunk_index:03d}/file-{file_index:03d}"
EPISODES = f"meta/episodes/{PART}.parquet"
DATA = f"data/{PART}.parquet"
VIDEOS = f"videos/{{video_key}}/{PART}.mp4"
CAMERAS = "observation.images."  # what the name of a camera's feature begins with

_MOST_ROWS = 1_000_000  # of a table


def place_in_file(camera: str) -> list[str]:
    """The columns of an episode table that say where ``camera`` saw an episode.

    They hold the two numbers of a file's name, and the episode's first and last second in it.
    """
    names = ("chunk_index", "file_index", "from_timestamp", "to_timestamp")
    return [f"videos/{camera}/{name}" for name in names]


def read_numbers(path: Path, columns: Sequence[str]) -> pd.DataFrame:
    """Columns of numbers out of a Parquet table.

    Raises AnyviewError naming the file if it is no such table, or lacks one of the columns.
    """
    try:
        with parquet.ParquetFile(path) as table:
            for column in columns:
                place = table.schema_arrow.get_field_index(column)
                if place < 0:
                    raise AnyviewError(f"{path}: no column {column}, which an episode table of {VERSION} has")
                kind = table.schema_arrow.field(place).type
                if not (arrow.types.is_integer(kind) or arrow.types.is_floating(kind)):
                    raise AnyviewError(f"{path}: column {column} holds no numbers")
            if table.metadata.num_rows > _MOST_ROWS:
                raise AnyviewError(f"{path}: more than {_MOST_ROWS} rows")
            return table.read(list(columns)).to_pandas(ignore_metadata=True)
    except (OSError, ValueError, arrow.ArrowException) as error:
        raise AnyviewError(f"{path}: not a Parquet table: {' '.join(str(error).split())}") from None


def write_table(path: Path, table: pd.DataFrame, index: bool = False) -> None:
    """Write a Parquet table; of the index only if asked for."""
    path.parent.mkdir(parents=True, exist_ok=True)
    parquet.write_table(arrow.Table.from_pandas(table, preserve_index=index), path)
