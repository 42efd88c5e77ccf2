"""The manifest of raw clips, written by hand as often as by `anyview record`."""

import csv
from pathlib import Path

import pandas as pd

from anyview.runtime.errors import AnyviewError
from anyview.video.manifests import RAW_COLUMNS


def read_raw_manifest(path: Path) -> pd.DataFrame:
    """The rows of ``path``, a CSV table with at least ``RAW_COLUMNS``; spaces around a cell do not count.

    Raises AnyviewError naming the file when it is missing or no such table, and the line of a row with more
    or fewer cells than the first: one comma too many would give every cell to its neighbour's column.
    """
    rows: list[list[str]] = []
    try:
        with path.open(newline="", encoding="utf-8-sig") as lines:
            reader = csv.reader(lines)
            for row in reader:
                cells = [cell.strip() for cell in row]
                if not any(cells):
                    continue
                rows.append(cells)
                if len(cells) != len(rows[0]):
                    raise AnyviewError(
                        f"{path}: line {reader.line_num} has {len(cells)} cells, the first has {len(rows[0])}"
                    )
    except FileNotFoundError:
        raise AnyviewError(f"{path}: no such file") from None
    except (csv.Error, UnicodeError) as error:
        raise AnyviewError(f"{path}: not a CSV table: {error}") from None
    names = rows[0] if rows else []
    missing = [column for column in RAW_COLUMNS if column not in names]
    if missing or len(set(names)) < len(names):
        found = f"no column {missing[0]}" if missing else "two columns of one name"
        raise AnyviewError(f"{path}: {found}; its first line must be {','.join(RAW_COLUMNS)}")
    return pd.DataFrame(rows[1:], columns=names, dtype=str)
