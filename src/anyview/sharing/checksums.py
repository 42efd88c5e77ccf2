"""Model folders from elsewhere, and their checksums: nothing is loaded before these are compared."""

import re
from pathlib import Path

from anyview import paths
from anyview.runtime.errors import AnyviewError
from anyview.runtime.once import sha256

CARD, SUMS = "README.md", "SHA256SUMS"
POLICIES = "policies"


def find_policies(method: str) -> Path:
    """The folder with the policies of ``method``: a cell of this study, or a model folder.

    Raises AnyviewError if there is none, or if a file of a model folder is not what its checksum says.
    """
    if (Path(method) / SUMS).is_file():
        verify(Path(method))
        return Path(method) / POLICIES
    folder = paths.policies(method)
    there = sorted(each.name for each in folder.parent.glob("*/"))
    if method not in there:
        raise AnyviewError(f"{method}: no such method was evaluated; there are {', '.join(there) or 'none'}")
    return folder


def find_model(model: str) -> Path:
    """The folder of the weights ``model``: a cell of this study, or any folder.

    Raises AnyviewError if that is part of a model folder and a file there is not what its checksum says.
    """
    folder = Path(model)
    if not folder.is_dir():
        return paths.model(model)
    if (folder.parent / SUMS).is_file():
        verify(folder.parent)
    return folder


def refuse_to_replace(folder: Path) -> None:
    """Raises AnyviewError if ``folder`` is there and no model folder."""
    if folder.exists() and not (folder / SUMS).is_file():
        raise AnyviewError(f"{folder}: is there already, and no model folder; name another place")


def verify(folder: Path) -> None:
    """Raises AnyviewError unless ``folder`` holds the files that its checksums list, and no others."""
    listed: dict[str, str] = {}
    for line in (folder / SUMS).read_text(encoding="utf-8", errors="replace").splitlines():
        found = re.fullmatch(r"([0-9a-f]{64})  ([\w-]+(?:[/.][\w-]+)*)", line)
        if not found:
            raise AnyviewError(f"{folder / SUMS}: not a list of checksums: {line[:80]}")
        listed[found[2]] = found[1]
    present = files_of(folder)
    for name in sorted(listed.keys() ^ set(present)):
        what = "missing" if name in listed else f"not in {SUMS}"
        raise AnyviewError(f"{folder / name}: {what}; pull the model again")
    for name in present:
        if sha256(folder / name) != listed[name]:
            raise AnyviewError(f"{folder / name}: damaged, not the file of {SUMS}; pull the model again")


def files_of(folder: Path) -> list[str]:
    """Files of a model folder that have a checksum, by their names in it."""
    names = [path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()]
    return sorted(name for name in names if name not in (CARD, SUMS))
