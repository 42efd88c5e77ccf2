"""Independent units of work, side by side: local processes by default, a Ray cluster by ANYVIEW_BACKEND=ray."""

import os
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

import joblib

from anyview.runtime.device import worker_count
from anyview.runtime.errors import AnyviewError

T = TypeVar("T")


def run_units(function: Callable[..., T], units: Sequence[tuple[Any, ...]]) -> Iterator[T]:
    """Yield ``function(*unit)`` for every unit, in order, as results arrive.

    A unit must not depend on how many workers there are: then results have the same bytes for any number.
    """
    backend = os.environ.get("ANYVIEW_BACKEND", "local")
    if backend not in ("local", "ray"):
        raise AnyviewError(f"ANYVIEW_BACKEND={backend}: must be local or ray")
    if backend == "ray":
        _use_ray()
    elif worker_count() == 1 or len(units) == 1:
        yield from (function(*unit) for unit in units)
        return
    parallel = joblib.Parallel(n_jobs=min(worker_count(), len(units)), return_as="generator", batch_size=1)
    yield from parallel(joblib.delayed(function)(*unit) for unit in units)


def _use_ray() -> None:
    try:
        import ray
        from ray.util.joblib import register_ray
    except ImportError:
        raise AnyviewError("ANYVIEW_BACKEND=ray: Ray is not installed; run `pip install anyview[cluster]`") from None
    if not ray.is_initialized():
        ray.init(address=os.environ.get("RAY_ADDRESS"), log_to_driver=False)
    register_ray()
    joblib.parallel_config(backend="ray")
