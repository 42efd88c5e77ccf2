"""Progress from what a command says."""

import pytest

from anyview.parallel.progress import Progress, read_progress


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ("ours: 30/120 (60 s left) loss 3\n", Progress(0.25, 60.0, "ours: 30/120 (60 s left) loss 3")),
        ("epoch 1/4\nsaved\n", Progress(0.25, 30.0, "epoch 1/4")),
        (" 10%|# | 1/10\r 50%|## | 5/10\r", Progress(0.5, 10.0, "50%|## | 5/10")),
        ("loss 0.5, 7/0, 9/3\n", Progress(None, None, "")),
        ("", Progress(None, None, "")),
    ],
)
def test_the_last_count_is_the_progress(tmp_path, said, expected):
    (tmp_path / "log").write_text(said)
    assert read_progress(tmp_path / "log", 10.0, None) == expected


def test_without_a_count_the_last_time_is_the_measure(tmp_path):
    assert read_progress(tmp_path / "none", 10.0, 40.0) == Progress(0.25, 30.0, "")
    assert read_progress(tmp_path / "none", 50.0, 40.0) == Progress(0.99, 0.0, "")
