"""Manifests: CSV tables that list clips, one a row."""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from anyview.runtime.errors import AnyviewError

KINDS = ("standard", "distractor", "extreme_view", "extreme_distractor")

_TEXT = ("clip", "file", "pair", "camera", "kind", "split", "sha256")


def read_table(path: Path, columns: Sequence[str], unique: str | None = None) -> pd.DataFrame:
    """Read a CSV table that has at least ``columns``; ids and names stay text, empty cells empty text.

    Raises AnyviewError naming the file when it is missing, no such table, or repeats a value of ``unique``.
    """
    try:
        table = pd.read_csv(path, dtype=dict.fromkeys(_TEXT, str), keep_default_na=False, encoding="utf-8")
    except FileNotFoundError:
        raise AnyviewError(f"{path}: no such file") from None
    except (ValueError, OverflowError) as error:  # pandas' parser and encoding errors are ValueErrors
        raise AnyviewError(f"{path}: not a CSV table: {' '.join(str(error).split())}") from None
    missing = [column for column in columns if column not in table.columns]
    if missing:
        raise AnyviewError(f"{path}: no column {missing[0]}; it needs {', '.join(columns)}")
    if unique is not None and table[unique].duplicated().any():
        repeated = table[unique][table[unique].duplicated()].iloc[0]
        raise AnyviewError(f"{path}: {unique} {repeated} is listed twice")
    return table
