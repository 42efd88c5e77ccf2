"""Marks of a set: those of these clips, or a line that says what is wrong."""

import numpy as np
import pytest

from anyview.runtime.errors import AnyviewError
from anyview.video.marks import marks_file, read_marks, write_marks


def test_marks_come_back(tmp_path):
    marks = np.arange(24, dtype=np.float32).reshape(2, 3, 2, 2)
    assert read_marks(tmp_path, 2, 3) is None
    assert marks_file(tmp_path) == []
    write_marks(tmp_path, marks)
    np.testing.assert_array_equal(read_marks(tmp_path, 2, 3), marks)
    assert marks_file(tmp_path) == [tmp_path / "marks.npy"]


@pytest.mark.parametrize(
    "marks",
    [
        np.zeros((2, 4, 5, 2), np.float32),
        np.zeros((2, 3, 5, 3), np.float32),
        np.zeros((2, 3), np.float32),
        np.zeros((2, 3, 5, 2)),
        np.full((2, 3, 5, 2), np.nan, np.float32),
    ],
)
def test_marks_of_other_clips_are_refused(tmp_path, marks):
    write_marks(tmp_path, marks)
    with pytest.raises(AnyviewError, match=r"marks\.npy"):
        read_marks(tmp_path, 2, 3)


@pytest.mark.parametrize("content", [b"", b"\x93NUMPY", b"\x80\x04."])
def test_damaged_marks_are_refused(tmp_path, content):
    (tmp_path / "marks.npy").write_bytes(content)
    with pytest.raises(AnyviewError, match=r"marks\.npy: damaged"):
        read_marks(tmp_path, 2, 3)
