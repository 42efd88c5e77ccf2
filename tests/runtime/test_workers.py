import sys
from pathlib import Path

import numpy as np
import pytest

from anyview.runtime.errors import AnyviewError
from anyview.runtime.workers import run_tasks

sys.path.insert(0, str(Path(__file__).parent))
from tasks import die, draw, mark, queue, refuse

TASKS = [(number,) for number in range(5)]


@pytest.fixture(params=["1", "2"])
def workers(request, monkeypatch) -> str:
    monkeypatch.setenv("ANYVIEW_WORKERS", request.param)
    return request.param


def test_results_come_in_order_with_the_same_bytes(workers):
    assert list(run_tasks(draw, TASKS)) == [draw(number) for (number,) in TASKS]


def test_results_come_as_they_are_ready(workers, tmp_path):
    """The first is there while the others still wait for the gate to open."""
    gate = tmp_path / "gate"
    results = run_tasks(queue, [(str(gate), number) for number in range(4)])
    assert next(results) == 0
    gate.touch()
    assert list(results) == [1, 2, 3]


def test_a_unit_may_write_to_a_large_array_of_its_own(workers):
    tasks = [(np.zeros(200_000), number) for number in (1, 2)]
    assert list(run_tasks(mark, tasks)) == [1, 2]


def test_a_user_error_in_a_worker_is_the_users(workers):
    with pytest.raises(AnyviewError, match=r"^clip-2.avi: cut short$"):
        list(run_tasks(refuse, TASKS))


def test_a_killed_worker_is_told(monkeypatch):
    monkeypatch.setenv("ANYVIEW_WORKERS", "2")
    with pytest.raises(AnyviewError, match="a worker process was killed"):
        list(run_tasks(die, TASKS))


@pytest.mark.parametrize(
    ("name", "value"), [("ANYVIEW_BACKEND", "cloud"), ("ANYVIEW_WORKERS", "0"), ("ANYVIEW_WORKERS", "two")]
)
def test_impossible_settings_are_named(monkeypatch, name, value):
    monkeypatch.setenv(name, value)
    with pytest.raises(AnyviewError, match=f"{name}={value}: must be"):
        list(run_tasks(draw, TASKS))


def test_ray_has_to_be_installed(monkeypatch):
    monkeypatch.setenv("ANYVIEW_BACKEND", "ray")
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(AnyviewError, match="Ray is not installed"):
        list(run_tasks(draw, TASKS))
