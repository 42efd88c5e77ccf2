"""What a report was made from, as DVC knows it.

A cached output must follow from its inputs alone, so that the page cannot name the Git revision that holds
it: that revision does not exist yet when the page is written. It names its inputs' DVC hashes instead, the
very ones in ``dvc.lock``; ``git log -S HASH -- dvc.lock`` then finds the revision.
"""

import hashlib
import json
from pathlib import Path

from anyview.runtime.scratch import content_key


def dvc_hash(path: Path) -> str:
    """The hash that DVC 3 gives a file (MD5) or a folder (MD5 of its sorted listing, ending in ``.dir``)."""
    if path.is_file():
        return _md5(path)
    files = sorted(entry for entry in path.rglob("*") if entry.is_file())
    relative = {entry.relative_to(path).parts: entry for entry in files}
    listing = [{"md5": _md5(entry), "relpath": "/".join(parts)} for parts, entry in sorted(relative.items())]
    return (
        hashlib.md5(json.dumps(listing, sort_keys=True).encode(), usedforsecurity=False).hexdigest() + ".dir"
    )


def _md5(path: Path) -> str:
    with path.open("rb") as handle:
        return hashlib.file_digest(handle, lambda: hashlib.md5(usedforsecurity=False)).hexdigest()


def params_key(params: object) -> str:
    """A short hash of all params: the values alone, not the file's comments or layout."""
    return content_key(params)[:12]
