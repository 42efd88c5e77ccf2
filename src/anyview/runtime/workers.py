"""Independent tasks, side by side: processes by default, a Ray cluster by ANYVIEW_BACKEND=ray.

Joblib has a Ray backend too, but that one runs tasks in actors, which are not retried when a node dies, and
yields nothing before the last task is done. Ray's plain tasks do both.
"""

import logging
import os
import re
import signal
import socket
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

import joblib
import numpy as np
from joblib.externals.loky.process_executor import TerminatedWorkerError

from anyview.runtime.device import worker_count
from anyview.runtime.errors import AnyviewError
from anyview.runtime.parent import end_with_parent

T = TypeVar("T")

RETRIES = 3  # of a Ray task whose node dies
_PATIENCE = 10  # seconds for a cluster's address to answer


def run_tasks(function: Callable[..., T], tasks: Sequence[tuple[Any, ...]]) -> Iterator[T]:
    """Yield ``function(*task)`` for every task, in order, as results arrive.

    A task must not depend on how many workers there are, and computes with a fixed number of threads: then
    results have the same bytes for any number of workers. On a cluster a task may run twice, because one
    whose node dies is tried again elsewhere, and every node must see the same working directory and scratch.
    """
    backend = os.environ.get("ANYVIEW_BACKEND", "local")
    if backend not in ("local", "ray"):
        raise AnyviewError(f"ANYVIEW_BACKEND={backend}: must be local or ray")
    if backend == "ray":
        yield from _run_on_ray(function, tasks)
    elif worker_count() == 1 or len(tasks) == 1:
        yield from (function(*task) for task in tasks)
    else:
        yield from _run_locally(function, tasks)


def _run_locally(function: Callable[..., T], tasks: Sequence[tuple[Any, ...]]) -> Iterator[T]:
    with joblib.parallel_config(backend="loky", inner_max_num_threads=1):
        parallel = joblib.Parallel(
            min(worker_count(), len(tasks)),
            return_as="generator",
            batch_size=1,
            mmap_mode="c",  # a large array is mapped, and a task may still write to its own
            initializer=_begin_worker,
            initargs=(os.getpid(),),
        )
    try:
        yield from parallel(joblib.delayed(function)(*task) for task in tasks)
    except TerminatedWorkerError:
        raise AnyviewError(
            "a worker process was killed, perhaps for want of memory; run the same command again, "
            "with fewer ANYVIEW_WORKERS if it happens again"
        ) from None


def _begin_worker(stage: int) -> None:
    """In a new worker: end with the process ``stage``, and leave Ctrl-C to it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent(stage)


def _run_on_ray(function: Callable[..., T], tasks: Sequence[tuple[Any, ...]]) -> Iterator[T]:
    ray = connect_to_ray()
    remote = ray.remote(num_cpus=1, max_retries=RETRIES)(_ray_task)
    shared = {name: value for name, value in os.environ.items() if name.startswith("ANYVIEW_")}
    function = ray.put(function)
    pending = deque(remote.remote(function, task, os.getcwd(), shared) for task in tasks)
    try:
        while pending:
            yield ray.get(pending[0])
            pending.popleft()
    except ray.exceptions.RayTaskError as error:
        raise error.cause from None
    except ray.exceptions.RayError as error:
        raise AnyviewError(f"Ray gave up on a task after {RETRIES} tries: {error}") from None
    finally:
        for reference in pending:
            ray.cancel(reference, force=True)


def _ray_task(
    function: Callable[..., T], task: tuple[Any, ...], folder: str, environment: dict[str, str]
) -> T:
    if not Path(folder).is_dir():
        raise AnyviewError(f"{folder}: a Ray node does not see it; keep the repository on shared storage")
    os.chdir(folder)
    os.environ.update(environment)
    # Ray shares arrays read-only; a task may write to its own, as it may in a local process.
    return function(*(np.array(value) if isinstance(value, np.ndarray) else value for value in task))


def connect_to_ray() -> Any:
    """Ray, connected to the cluster at ``RAY_ADDRESS`` or else to one of this machine's own."""
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    try:
        import ray
    except ImportError:
        raise AnyviewError(
            "ANYVIEW_BACKEND=ray: Ray is not installed; run `pip install anyview[cluster]`"
        ) from None
    if not ray.is_initialized():
        address = os.environ.get("RAY_ADDRESS")
        own: dict[str, Any] = {} if address else {"include_dashboard": False, "num_cpus": worker_count()}
        try:
            if address and (place := re.fullmatch(r"([\w.-]+):(\d{1,5})", address)):
                # Ray itself waits for minutes for a cluster that is not there.
                socket.create_connection((place[1], int(place[2])), timeout=_PATIENCE).close()
            ray.init(address, log_to_driver=False, logging_level=logging.ERROR, **own)
        except (OSError, OverflowError, ValueError) as error:
            raise AnyviewError(f"RAY_ADDRESS={address}: {error}") from None
    return ray
