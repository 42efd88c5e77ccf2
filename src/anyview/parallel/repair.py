"""What a killed DVC process can leave behind that would stop every later one."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dvc.repo import Repo


def drop_broken_rwlock(repo: "Repo") -> None:
    """Remove DVC's list of paths in use where it is cut short: it was being written at the kill.

    Under DVC's lock of the repository nobody writes it, so that what cannot be read then is a remnant.
    """
    path = Path(repo.tmp_dir) / "rwlock"
    with repo.lock:
        try:
            json.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            return
        except ValueError:
            path.unlink()
