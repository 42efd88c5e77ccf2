"""Tasks done once: an earlier result counts only while its files are what they were."""

import pytest

from anyview.runtime.once import once


@pytest.fixture
def task(tmp_path):
    """A task that counts how often it is done: (function, list of its calls)."""
    calls = []

    def make():
        calls.append(1)
        (tmp_path / "out.txt").write_text("made")
        return {"value": 0.1 + 0.2, "pair": (1, 2)}, ["out.txt"]

    return lambda: once(tmp_path, "task", make), calls


def test_a_result_is_made_once_and_is_the_same_from_the_record(task):
    do, calls = task
    assert do() == do() == {"value": 0.1 + 0.2, "pair": [1, 2]}
    assert len(calls) == 1


@pytest.mark.parametrize(
    ("file", "content"),
    [
        ("out.txt", None),
        ("out.txt", b"mad"),
        ("task.json", None),
        ("task.json", b""),
        ("task.json", b'{"result": 1}'),
        ("task.json", b'{"files": [], "result": 1}'),
        ("task.json", b'{"files": {"../../etc/passwd": "0"}, "result": 1}'),
        ("task.json", b"\xff\xfe"),
        ("task.json", b'{"files":' * 100_000),
    ],
)
def test_it_is_made_again_when_file_or_record_is_missing_or_altered(task, tmp_path, file, content):
    do, calls = task
    first = do()
    (tmp_path / file).unlink() if content is None else (tmp_path / file).write_bytes(content)
    assert do() == first
    assert len(calls) == 2
    assert (tmp_path / "out.txt").read_text() == "made"


def test_a_failed_unit_leaves_no_record(tmp_path):
    def fail():
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        once(tmp_path, "task", fail)
    assert list(tmp_path.iterdir()) == []
