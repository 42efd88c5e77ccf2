"""Where known things are in the frames of a set: only a set that was rendered can have such marks."""

from pathlib import Path

import numpy as np

from anyview.runtime.errors import AnyviewError

_FILE = "marks.npy"


def where_leaving(inside: np.ndarray, outside: np.ndarray) -> np.ndarray:
    """Where the ways from ``inside`` to ``outside`` leave the picture; either may be the other.

    All are (..., 2), from -1 to 1 in the picture.
    """
    way = outside - inside
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(way == 0, np.inf, (np.sign(way) - inside) / way).min(-1, keepdims=True)
    return inside + way * reach.clip(0, 1)


def write_marks(folder: Path, marks: np.ndarray) -> None:
    """Write ``marks``, float32 (N, T, M, 2): x and y in pixels of M things, also if hidden or outside."""
    np.save(folder / _FILE, marks, allow_pickle=False)


def marks_file(folder: Path) -> list[Path]:
    """The file with the marks of the set in ``folder``, if it has one."""
    path = folder / _FILE
    return [path] if path.exists() else []


def read_marks(folder: Path, clips: int, length: int) -> np.ndarray | None:
    """The marks of ``clips`` clips of ``length`` frames each, or None if the set has none.

    Raises AnyviewError if the file is damaged or of another set.
    """
    for path in marks_file(folder):
        try:
            marks = np.load(path, allow_pickle=False)
        except (OSError, ValueError, EOFError):
            raise AnyviewError(f"{path}: damaged; run `dvc checkout --force`") from None
        if marks.dtype != np.float32 or marks.shape != (clips, length, *marks.shape[2:3], 2):
            raise AnyviewError(
                f"{path}: it is not of these clips; run `dvc checkout --force` or the stage that makes it"
            )
        if not np.isfinite(marks).all():
            raise AnyviewError(f"{path}: a mark is no number; run `dvc checkout --force`")
        return marks
    return None
