"""End a process when its parent does: a signal to ``dvc`` alone would orphan the stage that it started."""

import ctypes
import os
import signal
import sys
import threading
import time
from typing import Any

_PR_SET_PDEATHSIG = 1
_POLL_SECONDS = 1.0
_GRACE_SECONDS = 20.0
_SHELLS = {"sh", "bash", "dash", "zsh", "fish", "ksh"}


def end_with_parent(parent: int | None = None) -> None:
    """End this process when its parent ends: SIGTERM, then, should that not be enough, SIGKILL.

    ``parent`` is the parent's process id, where the caller knows it: the parent may be gone by now.

    ``dvc`` starts a stage through a shell, which outlives a killed ``dvc``. So a thread watches the parent
    and, where that is ``dvc``'s shell, ``dvc`` too. On Linux the kernel reports the parent's end at once.
    """
    parent = os.getppid() if parent is None else parent
    if sys.platform.startswith("linux"):
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
        if os.getppid() != parent:  # it ended before we could ask
            os.kill(os.getpid(), signal.SIGTERM)
    threading.Thread(target=_watch, args=(_watched(parent),), name="parent", daemon=True).start()


def _watched(parent: int) -> list[Any]:
    """The parent process and, behind a shell of ``dvc``'s, the first process above that is no shell."""
    import psutil

    try:
        chain = [psutil.Process(parent)]
        while "DVC_STAGE" in os.environ and chain[-1].name() in _SHELLS and (above := chain[-1].parent()):
            chain.append(above)
    except psutil.Error:  # out of our sight, as on the other side of a container's wall
        return []
    return chain


def _watch(processes: list[Any]) -> None:
    if not processes:
        return
    while all(_alive(process) for process in processes):
        time.sleep(_POLL_SECONDS)
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(_GRACE_SECONDS)
    os.kill(os.getpid(), signal.SIGKILL)


def _alive(process: Any) -> bool:
    import psutil

    try:
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    except psutil.Error:
        return False
