"""Model folders: a method's weights with what they were made from, each file with its checksum.

- ``policies/``: ``policy-<run>.safetensors``, ``policy.json``, ``runs.csv``, ``curve.csv``;
- ``model/``: the translator or embedding of the method's reward, if it has one;
- ``rollout.mp4``: the run of median final distance, seen by its own camera;
- ``provenance.yaml``: the entries of dvc.lock that made policies, model and their data;
- ``SHA256SUMS``: checksums of all of these, for ``sha256sum -c`` too;
- ``README.md``: the card, without a checksum, because cards are edited where they are shown.

Nothing in a folder is code.
"""

import shutil
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from anyview import paths
from anyview.learners.common.policies import load_policy
from anyview.pusher.batch import PusherBatch
from anyview.pusher.episodes import film
from anyview.report.provenance import dvc_hash
from anyview.review.results import LOCK, read_lock
from anyview.review.revisions import Revision
from anyview.runtime.errors import AnyviewError
from anyview.runtime.once import sha256
from anyview.runtime.outputs import write_atomically
from anyview.sharing.checksums import CARD, POLICIES, SUMS, files_of, find_policies
from anyview.video.files import write_video

ROLLOUT, PROVENANCE, MODEL = "rollout.mp4", "provenance.yaml", "model"
_KINDS = (".csv", ".json", ".safetensors")
PATTERNS = [
    CARD,
    ROLLOUT,
    SUMS,
    PROVENANCE,
    *(f"{part}/*{kind}" for part in (POLICIES, MODEL) for kind in _KINDS),
]
"""Of the files that a model folder can have."""
_SIZE = 256  # pixels of the rollout

Lock = dict[str, dict[str, Any]]
"""Entries of dvc.lock by stage."""


def make_folder(folder: Path, method: str, run: int) -> Lock:
    """Put the method's weights, and a rollout of ``run``, into the empty ``folder``; returns its provenance.

    Raises AnyviewError if dvc.lock does not describe the weights: then nobody could tell what made them.
    """
    policies = find_policies(method)
    lock = _provenance(policies)
    _copy(policies, folder / POLICIES)
    for model in _models(lock):
        _copy(model, folder / MODEL)
    policy = load_policy(policies, run)
    pusher = PusherBatch([policy.context], policy.control, _SIZE)
    frames = film(pusher, lambda now: policy.act(now.observations[0])[None])[0]
    write_video(folder / ROLLOUT, frames, 10.0, "AV1")
    with (folder / PROVENANCE).open("w", encoding="utf-8") as file:
        YAML(typ="safe", pure=True).dump(lock, file)
    sums = [f"{sha256(folder / name)}  {name}\n" for name in files_of(folder)]
    write_atomically(folder / SUMS, "".join(sums))
    return lock


def _provenance(policies: Path) -> Lock:
    """The entries of dvc.lock that made ``policies`` and all that these learned from."""
    entries = _makers(read_lock(Revision(Path())), policies)
    for folder in (policies, *_models(entries)):
        stated = {each["md5"] for entry in entries.values() for each in _paths(entry) if _is(each, folder)}
        if stated != {dvc_hash(folder)}:
            raise AnyviewError(
                f"{folder}: not what {LOCK} describes; run `dvc repro` or `dvc checkout` first"
            )
    return entries


def _makers(lock: Lock, output: Path) -> Lock:
    """Of ``lock``, the stage that made ``output`` and those before it."""
    found: Lock = {}
    for stage, entry in lock.items():
        if any(_is(out, output) for out in entry.get("outs", [])):
            found[stage] = entry
            for dep in entry.get("deps", []):
                found |= _makers(lock, Path(dep["path"]))
    return found


def _models(lock: Lock) -> list[Path]:
    found = {Path(each["path"]) for entry in lock.values() for each in _paths(entry)}
    return sorted(path for path in found if path == paths.model(path.name))


def _paths(entry: dict[str, Any]) -> list[dict[str, Any]]:
    return entry.get("deps", []) + entry.get("outs", [])


def _is(stated: dict[str, Any], path: Path) -> bool:
    return stated["path"] == path.as_posix()


def _copy(source: Path, target: Path) -> None:
    target.mkdir()
    for path in source.iterdir():
        if path.suffix in _KINDS:
            shutil.copyfile(path, target / path.name)
