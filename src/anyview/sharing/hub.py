"""Model folders to and from a hub, by huggingface_hub: HF_ENDPOINT says which one, HF_TOKEN who you are."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from huggingface_hub import HfApi, snapshot_download
from huggingface_hub.errors import HTTPError

from anyview.runtime.errors import AnyviewError
from anyview.runtime.outputs import whole_folder
from anyview.sharing.checksums import SUMS, refuse_to_replace, verify
from anyview.sharing.folder import PATTERNS


def upload(repo: str, folder: Path, private: bool) -> str:
    """Let the model repository ``repo`` hold ``folder`` and nothing else; returns the commit's address.

    A repository that is not there is made, ``private`` or not. Raises AnyviewError if the hub refuses.
    """
    hub = HfApi(library_name="anyview")
    with _told(repo):
        hub.create_repo(repo, private=private, exist_ok=True)
        commit = hub.upload_folder(
            repo_id=repo, folder_path=folder, commit_message="anyview push", delete_patterns="*"
        )
    return str(commit.commit_url)


def download(repo: str, folder: Path, revision: str | None) -> None:
    """Make ``folder``, or replace it, by what ``repo`` holds at ``revision``, by default the newest.

    Raises AnyviewError if the hub refuses, or if what came is damaged or no model folder; ``folder`` stays as
    it was then.
    """
    refuse_to_replace(folder)
    with whole_folder(folder) as partial:
        with _told(repo):
            snapshot_download(
                repo, revision=revision, local_dir=partial, allow_patterns=PATTERNS, library_name="anyview"
            )
        shutil.rmtree(partial / ".cache", ignore_errors=True)  # huggingface_hub's notes on the download
        if not (partial / SUMS).is_file():
            raise AnyviewError(f"{repo}: no model of `anyview push`: it has no {SUMS}")
        verify(partial)


@contextmanager
def _told(repo: str) -> Iterator[None]:
    """Tell of what huggingface_hub raises as of bad input."""
    try:
        yield
    except (HTTPError, OSError, RuntimeError, ValueError) as error:
        raise AnyviewError(f"{repo}: {error}") from None
