"""The manifest of raw clips, written by hand as often as by `anyview record`."""

import csv
from pathlib import Path

import pandas as pd

from anyview.clips.manifests import RAW_COLUMNS, read_table
from anyview.runtime.errors import AnyviewError


def read_raw_manifest(path: Path) -> pd.DataFrame:
    """The rows of ``path``, a CSV table of ``RAW_COLUMNS``.

    Raises AnyviewError as ``read_table`` does, and for a row with more or fewer cells than the first line:
    one comma too many would give every cell to its neighbour's column.
    """
    table = read_table(path, RAW_COLUMNS)
    names = 0
    try:
        with path.open(newline="", encoding="utf-8") as lines:
            rows = csv.reader(lines)
            for row in rows:
                names = names or len(row)
                if row and len(row) != names:
                    raise AnyviewError(
                        f"{path}: line {rows.line_num} has {len(row)} cells, the first has {names}"
                    )
    except csv.Error as error:
        raise AnyviewError(f"{path}: not a CSV table: {error}") from None
    return table
