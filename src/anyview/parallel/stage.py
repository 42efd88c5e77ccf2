"""One stage, reproduced by DVC in a process of its own, which ends with the process that waits for it.

DVC's own ``Stage.reproduce`` under DVC's own locks: the cache, the run cache and the messages are DVC's. Only
the entry of dvc.lock is written by ``lockfile``. The process leads a process group, so that the stage's
command and all that it starts can be ended together.
"""

import json
import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from anyview.parallel.lockfile import write_entry
from anyview.parallel.schedule import State

if TYPE_CHECKING:
    from dvc.repo import Repo
    from dvc.stage import Stage

GRACE_SECONDS = 20.0  # from SIGTERM to SIGKILL: a stage writes its checkpoint
_POLL_SECONDS = 0.01
_BUSY_SECONDS = 1.0

_ending = threading.Event()  # the lifeline is at its end


class _Stopped(BaseException):
    """SIGTERM while DVC works: let go of its locks."""


@dataclass(frozen=True)
class Order:
    """What to do: reproduce ``address``, with ``environment`` for its command, and ``log`` what is said.

    ``later``: see ``lockfile.write_entry``.
    """

    address: str
    force: bool
    environment: dict[str, str]
    later: tuple[str, ...]
    log: str


@dataclass(frozen=True)
class Result:
    """How ``address`` ended; ``seconds`` are its command's alone."""

    address: str
    state: State
    seconds: float = 0.0
    message: str = ""


def lead_group(order: Order, lifeline: int) -> None:
    """Make this process the leader of a group that ends at the end of the file ``lifeline``.

    What it says, and what the stage's command says, goes to the log.
    """
    os.setpgid(0, 0)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.signal(signal.SIGTERM, _stop)
    Path(order.log).parent.mkdir(parents=True, exist_ok=True)
    log = os.open(order.log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
    null = os.open(os.devnull, os.O_RDONLY)
    for source, target in ((null, 0), (log, 1), (log, 2)):
        os.dup2(source, target)
    threading.Thread(target=_end_with, args=(lifeline,), daemon=True).start()


def _stop(signum: int, frame: Any) -> None:
    """A command ends by the signal that its whole group gets, and then DVC lets go of its locks."""
    try:
        os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT)
    except ChildProcessError:
        raise _Stopped from None


def _end_with(lifeline: int) -> None:
    os.read(lifeline, 1)
    _ending.set()
    end_group(os.getpgid(0), spare=os.getpid())


def end_group(group: int, spare: int = 0) -> None:
    """SIGTERM to all processes of ``group``, and SIGKILL to those that stay; returns when they are gone.

    ``spare`` is not waited for, because it is the one that waits.
    """
    deadline = time.monotonic() + GRACE_SECONDS
    while time.monotonic() < deadline and members(group) - {spare}:
        signal_group(group, signal.SIGTERM)
        again = time.monotonic() + 1
        while time.monotonic() < again and members(group) - {spare}:
            time.sleep(0.02)
    signal_group(group, signal.SIGKILL)


def members(group: int) -> set[int]:
    """Living processes of ``group``."""
    import psutil

    found = set()
    for process in psutil.process_iter(["status"]):
        try:
            if os.getpgid(process.pid) == group and process.info["status"] != psutil.STATUS_ZOMBIE:
                found.add(process.pid)
        except (ProcessLookupError, PermissionError):
            continue
    return found


def signal_group(group: int, number: int) -> None:
    """Send signal ``number`` to all processes of ``group``, if there are any."""
    with suppress(ProcessLookupError):
        os.killpg(group, number)


def reproduce(stage: "Stage", order: Order) -> Result:
    """Let DVC reproduce ``stage``, waiting for other DVC processes as long as it takes."""
    from dvc.lock import LockError  # raised, too, where another process uses a stage's paths
    from dvc.repo import lock_repo

    try:
        while True:
            lock = stage.repo.lock = _timed_lock(stage.repo)
            try:
                with lock_repo(stage.repo), stage.repo.scm_context(quiet=True):
                    state = _reproduce(stage, order)
                break
            except LockError as error:
                print(f"waiting: {error}", flush=True)
                time.sleep(_BUSY_SECONDS)
    except _Stopped:
        told = "ended by SIGTERM; run the same command again to continue"
        return Result(order.address, State.INTERRUPTED, message=told)
    except Exception as error:
        logging.getLogger("dvc").error("failed to reproduce '%s': %s", order.address, error)
        return Result(order.address, State.FAILED, lock.away, " ".join(str(error).split()))
    if state is State.RAN and not lock.away:
        state = State.CACHED
    return Result(order.address, state, lock.away)


def _reproduce(stage: "Stage", order: Order) -> State:
    from dvc.stage import PipelineStage

    if stage.frozen and not stage.is_import:
        logging.getLogger("dvc").warning(
            "%s is frozen. Its dependencies are not going to be reproduced.", stage
        )
    # Asked first, under locks for reading: DVC would lock an unchanged stage's outputs for writing, and so
    # wait for whoever reads them.
    if not order.force and not stage.changed():
        logging.getLogger("dvc").info("Stage '%s' didn't change, skipping", stage.addressing)
        return State.UNCHANGED
    if stage.reproduce(force=order.force, interactive=False, run_env=order.environment) is None:
        return State.UNCHANGED
    if isinstance(stage, PipelineStage):
        write_entry(stage, order.later)
    else:
        stage.dump(update_pipeline=False)
    return State.RAN


def _timed_lock(repo: "Repo") -> Any:
    """DVC's lock of ``repo``, asked for often, which knows for how long it was let go: a command ran then."""
    from dvc.lock import HardlinkLock, Lock, LockError

    class Timed:
        away = 0.0
        _released = 0.0

        def lock(self, *arguments: Any) -> None:
            if self._released:
                self.away += time.monotonic() - self._released
                self._released = 0.0
            super().lock(*arguments)  # type: ignore[misc]

        def unlock(self, *arguments: Any, **keywords: Any) -> None:
            super().unlock(*arguments, **keywords)  # type: ignore[misc]
            self._released = time.monotonic()

    class Quick(Lock):
        def lock(self) -> None:
            while True:
                try:
                    return self._do_lock()
                except LockError:
                    time.sleep(_POLL_SECONDS)

    own = repo.lock
    if isinstance(own, HardlinkLock):
        kind = type("TimedHardlinkLock", (Timed, HardlinkLock), {})
        return kind(own.lockfile, tmp_dir=repo.tmp_dir, wait=True)
    return type("TimedLock", (Timed, Quick), {})(own.lockfile, wait=True)


def perform(stage: "Stage", order: Order, send: Callable[[bytes], object]) -> None:
    """Reproduce ``stage`` and ``send`` the result as JSON."""
    result = reproduce(stage, order)
    sys.stdout.flush()
    if _ending.is_set():
        threading.Event().wait()  # for SIGKILL: until then, the thread looks after the rest of the group
    send(json.dumps(asdict(result)).encode())


def read_result(text: bytes) -> Result:
    """What ``perform`` sent."""
    values = json.loads(text)
    return Result(**values | {"state": State(values["state"])})


def main() -> NoReturn:
    """Perform the order in the first argument; its result is a line of standard output.

    Standard input is the lifeline: the process ends with whoever holds its other end.
    """
    from anyview.parallel.graph import open_repository

    order = Order(**json.loads(sys.argv[1]))
    lifeline, wire = os.dup(0), os.dup(1)
    lead_group(order, lifeline)
    with open_repository() as repo:
        (stage,) = repo.stage.collect(order.address)
        perform(stage, order, lambda answer: os.write(wire, answer))
    os._exit(0)


if __name__ == "__main__":
    main()
