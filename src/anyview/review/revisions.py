"""Files as they stand at a Git revision, in an experiment of DVC or in the working tree."""

import subprocess
from dataclasses import dataclass
from pathlib import Path

from anyview.runtime.errors import AnyviewError


@dataclass(frozen=True)
class Revision:
    """One state of the project at ``root``: the commit ``sha``, or the working tree if it is None."""

    root: Path
    sha: str | None = None

    @property
    def name(self) -> str:
        """Short, for a reader."""
        return self.sha[:10] if self.sha else "working tree"

    def read(self, path: str) -> bytes | None:
        """The content of ``path``, relative to ``root``; None if this state has no such file."""
        if self.sha is None:
            file = self.root / path
            return file.read_bytes() if file.is_file() else None
        if path not in self.files(path):
            return None
        return _git(self.root, "show", f"{self.sha}:./{path}")

    def files(self, path: str) -> list[str]:
        """Files at or below ``path``, relative to ``root``, sorted."""
        if self.sha is None:
            place = self.root / path
            files = [place] if place.is_file() else [entry for entry in place.rglob("*") if entry.is_file()]
            return sorted(entry.relative_to(self.root).as_posix() for entry in files)
        listing = _git(self.root, "ls-tree", "-r", "-z", "--name-only", self.sha, "--", path)
        return sorted(listing.decode().split("\0")[:-1])

    def experiments(self) -> dict[str, "Revision"]:
        """The finished experiments of `dvc exp` that started from this commit, by name.

        DVC keeps each as a commit at ``refs/exps/<first two digits>/<the others>/<name>``.
        """
        place = f"refs/exps/{self.sha[:2]}/{self.sha[2:]}/" if self.sha else ""
        listing = _git(self.root, "for-each-ref", "--format=%(objectname) %(refname:lstrip=4)", place)
        entries = (line.split(" ", 1) for line in listing.decode().splitlines())
        return {name: Revision(self.root, sha) for sha, name in entries}


def find_revision(root: Path, revision: str) -> Revision:
    """The commit that ``revision`` (a branch, tag, hash, ``HEAD~1``) names, or AnyviewError."""
    if _run(root, "rev-parse", "--git-dir").returncode:
        raise AnyviewError(f"{root.resolve()}: not inside a Git repository")
    found = _run(root, "rev-parse", "--verify", "--quiet", "--end-of-options", f"{revision}^{{commit}}")
    if found.returncode:
        raise AnyviewError(f"{revision!r}: no such revision; name a branch, a tag or a commit")
    return Revision(root, found.stdout.decode().strip())


def _git(root: Path, *arguments: str) -> bytes:
    done = _run(root, *arguments)
    if done.returncode:
        reason = " ".join(done.stderr.decode(errors="replace").split())
        raise AnyviewError(f"git {arguments[0]}: {reason or 'failed'}")
    return done.stdout


def _run(root: Path, *arguments: str) -> subprocess.CompletedProcess[bytes]:
    try:
        return subprocess.run(["git", *arguments], cwd=root, capture_output=True, check=False)
    except FileNotFoundError:
        raise AnyviewError("git: not found; install it to compare revisions") from None
