"""Errors that a user can act on, and how a stage ends on them."""

import signal
import sys
from collections.abc import Callable
from types import FrameType
from typing import NoReturn

from anyview.runtime.parent import end_with_parent

BAD_INPUT = 2
INTERRUPTED = 130


class AnyviewError(Exception):
    """Bad input or a broken environment: one line that says which file, which key and what to do."""


class Terminated(BaseException):
    """SIGTERM arrived: unwind as on Ctrl-C, so that temporary outputs are removed."""


def _raise_terminated(signum: int, frame: FrameType | None) -> NoReturn:
    raise Terminated


def run_stage(main: Callable[[list[str]], None]) -> NoReturn:
    """Run a stage's ``main(arguments)`` and exit as a user would expect.

    Exit codes: 0 done, 2 bad input (one line on standard error, no traceback), 130 interrupted. The
    process ends when its parent does, so that a killed ``dvc repro`` leaves no orphan behind.
    """
    end_with_parent()
    signal.signal(signal.SIGTERM, _raise_terminated)
    try:
        main(sys.argv[1:])
    except AnyviewError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(BAD_INPUT)
    except OSError as error:
        if error.filename is None and error.errno is None:
            raise
        print(f"error: {error.filename or 'file system'}: {error.strerror or error}", file=sys.stderr)
        sys.exit(BAD_INPUT)
    except (KeyboardInterrupt, Terminated):
        print("interrupted: run the same command again to continue", file=sys.stderr)
        sys.exit(INTERRUPTED)
    sys.exit(0)
