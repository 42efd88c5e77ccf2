"""Manifests of raw clips as people write them."""

import pytest

from anyview.ingest.clips import read_candidates
from anyview.runtime.errors import AnyviewError


@pytest.mark.parametrize(
    ("row", "cells"), [("a.avi,1,left,standard,", 5), ("a.avi,1,left", 3), ('"a.avi,1",left,standard', 3)]
)
def test_a_row_of_a_manifest_with_a_comma_too_many_or_too_few_is_named(tmp_path, row, cells):
    (tmp_path / "manifest.csv").write_text(f"file,pair,camera,kind\nb.avi,2,left,standard\n\n{row}\n")
    with pytest.raises(AnyviewError, match=rf"manifest\.csv: .*line 4(,| has| saw)* {cells}"):
        read_candidates(tmp_path)
    (tmp_path / "manifest.csv").write_text("file,pair,camera,kind\na.avi,1,left,standard,\n")
    with pytest.raises(AnyviewError, match=r"manifest\.csv: line 2 has 5 cells, the first has 4"):
        read_candidates(tmp_path)


def test_spaces_around_a_cell_and_a_byte_order_mark_do_not_count(tmp_path):
    (tmp_path / "manifest.csv").write_text(
        "\ufefffile, pair, camera, kind\na.avi, 1, left, standard\n", encoding="utf-8"
    )
    (clip,) = read_candidates(tmp_path)
    assert (clip.file, clip.pair, clip.camera, clip.kind) == ("a.avi", "1", "left", "standard")
    (tmp_path / "manifest.csv").write_text("file;pair;camera;kind\na.avi;1;left;standard\n")
    with pytest.raises(AnyviewError, match=r"no column file; its first line must be file,pair,camera,kind"):
        read_candidates(tmp_path)


def test_a_cell_that_no_name_is_as_long_as_is_told(tmp_path):
    (tmp_path / "manifest.csv").write_text(f"file,pair,camera,kind\na.avi,{'1' * 200_000},left,standard\n")
    with pytest.raises(AnyviewError, match=r"manifest\.csv: not a CSV table: field larger than"):
        read_candidates(tmp_path)
