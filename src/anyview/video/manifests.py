"""Manifests: CSV tables that list clips, one a row; and the sidecars with the times of a clip's frames."""

import re
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from anyview.runtime.errors import AnyviewError

KINDS = ("standard", "distractor", "extreme_view", "extreme_distractor")
RAW_COLUMNS = ("file", "pair", "camera", "kind")
STRETCH_COLUMNS = ("start", "end")  # a raw manifest may have them
VIDEO_SUFFIXES = frozenset(
    (
        ".avi",
        ".mp4",
        ".mov",
        ".mkv",
        ".webm",
        ".m4v",
        ".mpg",
        ".mpeg",
        ".ts",
        ".mts",
        ".m2ts",
        ".vob",
        ".wmv",
        ".flv",
        ".asf",
        ".ogv",
        ".3gp",
        ".dv",
    )
)

_TEXT = ("clip", "file", "pair", "camera", "kind", "split", "sha256", "reason")
_CAMERA = "left|right|front|side|top|[a-d]"
# A number alone counts demonstrations: a camera's has the word before it.
_CAMERA_WORD = re.compile(rf"[-_ .](?:cam(?:era)?[-_ ]?({_CAMERA}|[0-9]+)|({_CAMERA}))$", re.I)


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


def times_file(file: str) -> str:
    """The name of a recorded clip's sidecar: a table with a column ``seconds``, a row for each frame."""
    return str(Path(file).with_suffix(".times.csv"))


def propose_manifest(folder: Path) -> pd.DataFrame:
    """A manifest for the videos in a folder that has none, guessed from their names.

    ``push-03-left.mp4`` and ``push-03-right.mp4`` become a pair; a path that contains a kind has it.
    """
    rows = []
    for path in sorted(folder.rglob("*")):
        if path.suffix.lower() not in VIDEO_SUFFIXES or not path.is_file():
            continue
        file = path.relative_to(folder).as_posix()
        stem = str(Path(file).with_suffix(""))
        camera = _CAMERA_WORD.search(stem)
        words = re.sub("[- ]", "_", stem.lower())
        kind = next((kind for kind in reversed(KINDS) if kind in words), KINDS[0])
        rows.append(
            {
                "file": file,
                "pair": stem[: camera.start()] if camera else stem,
                "camera": camera[camera.lastindex or 0].lower() if camera else "",
                "kind": kind,
            }
        )
    return pd.DataFrame(rows, columns=list(RAW_COLUMNS))
