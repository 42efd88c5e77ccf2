"""End a process when its parent does: SIGTERM or SIGKILL to ``dvc`` alone would orphan the stage."""

import ctypes
import os
import signal
import sys
import threading
import time

_PR_SET_PDEATHSIG = 1
_POLL_SECONDS = 2.0


def end_with_parent() -> None:
    """Ask for SIGTERM when the parent process dies.

    On Linux the kernel sends it. ``dvc`` starts a stage through a shell, so the parent may be a shell
    that outlives ``dvc``: a daemon thread therefore also watches the chain up to the first ``dvc``.
    """
    if sys.platform.startswith("linux"):
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    ancestors = _ancestors()
    if ancestors:
        threading.Thread(target=_watch, args=(ancestors,), daemon=True).start()


def _ancestors() -> list[tuple[int, float]]:
    """(pid, start time) of the parent, and of its parent when a shell or ``dvc`` stands between."""
    import psutil

    chain: list[tuple[int, float]] = []
    try:
        process = psutil.Process().parent()
        while process is not None and process.pid > 1:
            name = " ".join(process.cmdline()[:3])
            chain.append((process.pid, process.create_time()))
            if "dvc" in name:
                return chain
            process = process.parent()
    except psutil.Error:
        return []
    return chain[:1]


def _watch(ancestors: list[tuple[int, float]]) -> None:
    import psutil

    while all(_alive(psutil, pid, started) for pid, started in ancestors):
        time.sleep(_POLL_SECONDS)
    os.kill(os.getpid(), signal.SIGTERM)


def _alive(psutil, pid: int, started: float) -> bool:
    try:
        process = psutil.Process(pid)
        return process.create_time() == started and process.status() != psutil.STATUS_ZOMBIE
    except psutil.Error:
        return False
