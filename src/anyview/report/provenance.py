"""What a report was made from, as DVC knows it.

A cached output must follow from its inputs alone, so that the page cannot name the Git revision that holds
it: that revision does not exist yet when the page is written. It names its inputs' DVC hashes instead, the
very ones in ``dvc.lock``; ``git log -S HASH -- dvc.lock`` then finds the revision.
"""

import hashlib
import json
from pathlib import Path


def dvc_hash(path: Path) -> str:
    """The hash that DVC 3 gives a file (MD5) or a folder (MD5 of its sorted listing, ending in ``.dir``)."""
    if path.is_file():
        return _md5(path)
    files = {entry.relative_to(path).as_posix(): entry for entry in path.rglob("*") if entry.is_file()}
    listing = [{"md5": _md5(files[name]), "relpath": name} for name in sorted(files)]
    return (
        hashlib.md5(json.dumps(listing, sort_keys=True).encode(), usedforsecurity=False).hexdigest() + ".dir"
    )


def _md5(path: Path) -> str:
    with path.open("rb") as handle:
        return hashlib.file_digest(handle, lambda: hashlib.md5(usedforsecurity=False)).hexdigest()
