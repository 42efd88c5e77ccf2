"""Which device computes, and how: machine facts that come from the environment, never from params."""

import os
from typing import TYPE_CHECKING

import joblib

from anyview.runtime.errors import AnyviewError

if TYPE_CHECKING:  # most stages do without PyTorch, which takes seconds to import
    import torch


def torch_device() -> "torch.device":
    """The device that ``ANYVIEW_DEVICE`` (auto, cpu or cuda; default auto) asks for."""
    import torch

    wish = os.environ.get("ANYVIEW_DEVICE", "auto")
    if wish not in ("auto", "cpu", "cuda"):
        raise AnyviewError(f"ANYVIEW_DEVICE={wish}: must be auto, cpu or cuda")
    if wish == "cuda" and not torch.cuda.is_available():
        raise AnyviewError("ANYVIEW_DEVICE=cuda: PyTorch finds no CUDA device; set it to auto or cpu")
    return torch.device("cuda" if wish != "cpu" and torch.cuda.is_available() else "cpu")


def computes_bfloat16(device: "torch.device") -> bool:
    """Whether ``device`` has instructions for bfloat16 products; without them these are 10 times slower."""
    import torch

    if device.type != "cpu":
        return True
    found = torch.cpu.get_capabilities()
    return any(found.get(name, False) for name in ("avx512_bf16", "amx_bf16"))


def dtype_of_products(precision: str, device: "torch.device") -> "torch.dtype":
    """In what matrix products are computed: bfloat16 if it is the ``precision`` and ``device`` has it."""
    import torch

    return torch.bfloat16 if precision == "bfloat16" and computes_bfloat16(device) else torch.float32


def products_in(precision: str, device: "torch.device") -> "torch.autocast":
    """A context whose matrix products are in ``dtype_of_products``."""
    import torch

    dtype = dtype_of_products(precision, device)
    # Threads would share the cache of converted weights: what each found there would be up to chance.
    return torch.autocast(device.type, torch.bfloat16, enabled=dtype is torch.bfloat16, cache_enabled=False)


def use_threads(count: int) -> None:
    """Fix the intra-op threads: reductions split by thread count, so a fixed count keeps the bytes fixed."""
    import torch

    torch.set_num_threads(count)


def worker_count() -> int:
    """Worker processes that ``ANYVIEW_WORKERS`` asks for (default: the cores that we may use, at most 16)."""
    text = os.environ.get("ANYVIEW_WORKERS", "")
    if not text:
        return min(joblib.cpu_count(), 16)
    if not text.isascii() or not text.isdigit() or int(text) < 1:
        raise AnyviewError(f"ANYVIEW_WORKERS={text}: must be a whole number of at least 1")
    return int(text)
