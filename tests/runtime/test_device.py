import pytest
import torch

from anyview.runtime.device import torch_device, use_threads, worker_count
from anyview.runtime.errors import AnyviewError


@pytest.mark.parametrize("wish", ["auto", "cpu"])
def test_a_device_that_works_is_found(monkeypatch, wish):
    monkeypatch.setenv("ANYVIEW_DEVICE", wish)
    assert torch.ones(2, device=torch_device()).sum() == 2


def test_cuda_where_there_is_none(monkeypatch):
    monkeypatch.setenv("ANYVIEW_DEVICE", "cuda")
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(AnyviewError, match="ANYVIEW_DEVICE=cuda: PyTorch finds no CUDA device"):
        torch_device()


def test_an_unknown_device(monkeypatch):
    monkeypatch.setenv("ANYVIEW_DEVICE", "gpu")
    with pytest.raises(AnyviewError, match="must be auto, cpu or cuda"):
        torch_device()


def test_workers_default_to_the_cores(monkeypatch):
    monkeypatch.delenv("ANYVIEW_WORKERS", raising=False)
    assert 1 <= worker_count() <= 16
    monkeypatch.setenv("ANYVIEW_WORKERS", "3")
    assert worker_count() == 3


def test_threads():
    before = torch.get_num_threads()
    use_threads(1)
    assert torch.get_num_threads() == 1
    use_threads(before)
