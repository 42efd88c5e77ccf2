"""Errors that a user can act on, and how a stage or a command ends on them."""

import errno
import os
import signal
import sys
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from types import FrameType
from typing import NoReturn

from anyview.runtime.parent import end_with_parent

BAD_INPUT = 2
INTERRUPTED = 130
_LONGEST = 2000  # characters of a message, should the input that it quotes be longer


class AnyviewError(Exception):
    """Bad input or a broken environment: one line that says which file, which key and what to do."""


class Terminated(BaseException):
    """SIGTERM arrived: unwind as on Ctrl-C, so that temporary outputs are removed."""


def choose(arguments: list[str], choices: Iterable[str], usage: str) -> str:
    """The one argument of a stage, of ``choices``. Raises AnyviewError if it is missing or another."""
    if len(arguments) != 1 or arguments[0] not in choices:
        raise AnyviewError(f"usage: {usage}, where {usage.split()[-1]} is one of {', '.join(choices)}")
    return arguments[0]


def choose_each(arguments: list[str], choices: Mapping[str, Iterable[object]], script: str) -> list[str]:
    """Arguments of the stage ``python script``, one of each of ``choices``, as ``choose`` does.

    The keys are what the usage calls them.
    """
    usage, chosen = f"python {script}", []
    for place, (name, known) in enumerate(choices.items()):
        usage += f" {name}"
        last = place == len(choices) - 1
        given = arguments[place:] if last else arguments[place : place + 1]
        chosen.append(choose(given, list(map(str, known)), usage))
    return chosen


def refuse_arguments(arguments: list[str], usage: str) -> None:
    """Raises AnyviewError if a stage that takes no ``arguments`` is given some."""
    if arguments:
        raise AnyviewError(f"usage: {usage}")


def run_stage(main: Callable[[list[str]], None]) -> NoReturn:
    """Run a stage's ``main(arguments)`` and exit as a user would expect (see ``exit_code``).

    The process ends when its parent does, so that a killed ``dvc repro`` leaves no orphan behind.
    """
    end_with_parent()
    raise_when_terminated()
    code = exit_code(lambda: main(sys.argv[1:]), "interrupted: run the same command again to continue")
    if code == INTERRUPTED:
        # Workers end with this process. Python would wait for theirs and for every thread, at worst for ever.
        with suppress(OSError):
            sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    sys.exit(code)


def raise_when_terminated() -> None:
    """Let SIGTERM raise ``Terminated`` in the main thread from now on."""
    signal.signal(signal.SIGTERM, _raise_terminated)


def exit_code(action: Callable[[], object], interrupted: str = "interrupted") -> int:
    """Run ``action``: 0 done, 2 bad input (one line on standard error, no traceback), 130 interrupted."""
    try:
        action()
        sys.stdout.flush()
    except AnyviewError as error:
        print(f"error: {' '.join(str(error).split())[:_LONGEST]}", file=sys.stderr)
        return BAD_INPUT
    except MemoryError:
        print(
            "error: not enough memory; ask for less in params.yaml, or set fewer ANYVIEW_WORKERS",
            file=sys.stderr,
        )
        return BAD_INPUT
    except BrokenPipeError:  # the reader of a pipe, such as `head`, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        if error.errno is None:
            raise
        print(f"error: {_explain(error)}", file=sys.stderr)
        return BAD_INPUT
    except (KeyboardInterrupt, Terminated):
        print(interrupted, file=sys.stderr)
        return INTERRUPTED
    return 0


def _explain(error: OSError) -> str:
    name = f"{error.filename}: " if error.filename is not None else ""
    hint = {
        errno.ENOSPC: "; free some space and run the same command again to continue",
        errno.EROFS: "; write to a folder that is not read-only",
        errno.EACCES: "; check the permissions",
    }.get(error.errno or 0, "")
    return f"{name}{error.strerror or error}{hint}"


def _raise_terminated(signum: int, frame: FrameType | None) -> NoReturn:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # once is enough: a second must not cut the clean-up short
    raise Terminated
