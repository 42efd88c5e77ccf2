"""Raw clips into short, small, even ones: each gets its verdict, and none stops the others."""

import hashlib
import re
import shutil
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from anyview.config import Ingest
from anyview.ingest.normalize import Refused, parse_stretch, read_clip
from anyview.ingest.raw_manifest import read_raw_manifest
from anyview.runtime.errors import AnyviewError
from anyview.runtime.once import once, sha256
from anyview.runtime.outputs import write_atomically
from anyview.video.manifests import KINDS, RAW_COLUMNS, propose_manifest, times_file
from anyview.video.sets import StoredFile, write_clips, write_set

EXTREME = KINDS[-1]  # clips of scenes that training never sees
_COLUMNS = ("clip", *RAW_COLUMNS)  # of a finished set's manifest


@dataclass(frozen=True)
class Candidate:
    """A row of a raw manifest; ``clip`` is the id that the finished clip will have.

    ``start`` and ``end`` are as the manifest has them: seconds, or both empty.
    """

    clip: str
    file: str
    pair: str
    camera: str
    kind: str
    start: str = ""
    end: str = ""


@dataclass(frozen=True)
class Verdict:
    """What became of a candidate: ``reason`` is empty for a finished clip."""

    reason: str
    stored: dict[str, Any] | None = None
    pictures: str = ""  # SHA-256 of the finished frames


def read_candidates(source: Path) -> list[Candidate]:
    """The clips that ``source/manifest.csv`` lists.

    Where there is none, one is proposed beside it, and the AnyviewError says so.
    """
    path = source / "manifest.csv"
    if not source.is_dir():
        raise AnyviewError(
            f"{source}: no such folder; `anyview record` fills data/raw/recorded, `dvc repro film` "
            "data/raw/surrogate"
        )
    if not path.exists():
        proposal = propose_manifest(source)
        if proposal.empty:
            raise AnyviewError(f"{source}: no video files; fill it with `anyview record` or your own clips")
        write_atomically(source / "manifest.proposed.csv", proposal.to_csv(index=False))
        raise AnyviewError(
            f"{path}: no such file; check manifest.proposed.csv beside it and rename it "
            "(`anyview clips --propose` also finds where the demonstrations are)"
        )
    candidates: list[Candidate] = []
    taken: Counter[str] = Counter()
    for row in read_raw_manifest(path).to_dict("records"):
        stem = _slug(row["file"])
        taken[stem.lower()] += 1
        clip = stem if taken[stem.lower()] == 1 else f"{stem}~{taken[stem.lower()]}"
        stretch = row.get("start", ""), row.get("end", "")
        candidates.append(
            Candidate(clip, row["file"], row["pair"] or clip, row["camera"], row["kind"], *stretch)
        )
    if not candidates:
        raise AnyviewError(f"{path}: it lists no clips")
    return candidates


def _slug(file: str) -> str:
    """A file's path as a plain name."""
    stem = re.sub(r"\.[^./]*$", "", file)
    return re.sub(r"[^A-Za-z0-9._-]+", "-", stem).strip(".-")[:80] or "clip"


def ingest_clip(source: Path, folder: Path, candidate: Candidate, limits: Ingest) -> Verdict:
    """Normalise one raw clip and write the finished one to ``folder``, unless an earlier try did.

    ``folder`` is scratch space keyed by the limits and the code (see ``runtime.once``).
    """
    try:
        path = _locate(source, candidate)
        stretch = parse_stretch(candidate.start, candidate.end)
        if path.stat().st_size > limits.max_megabytes * 1e6:
            raise Refused(f"larger than {limits.max_megabytes:g} MB")
        content = sha256(path)
        times = path.with_name(times_file(path.name))
        if times.is_file():
            content += sha256(times)
    except Refused as refusal:
        return Verdict(str(refusal))
    except OSError as error:
        return Verdict(f"cannot be read: {error.strerror}")

    def make() -> tuple[dict[str, Any], list[str]]:
        try:
            frames = read_clip(path, limits, stretch)
        except Refused as refusal:
            return asdict(Verdict(str(refusal))), []
        stored = write_clips(folder / f"{candidate.clip}.avi", frames[None], limits.rate, "XVID")
        return asdict(Verdict("", asdict(stored), hashlib.sha256(frames.tobytes()).hexdigest())), [
            stored.file
        ]

    name = hashlib.sha256(f"{candidate.clip}/{content}/{stretch}".encode()).hexdigest()[:32]
    return Verdict(**once(folder, name, make))


def _locate(source: Path, candidate: Candidate) -> Path:
    if candidate.kind not in KINDS:
        raise Refused(f"kind {candidate.kind!r} is none of {', '.join(KINDS)}")
    try:
        path = (source / candidate.file).resolve()
        inside = path.is_relative_to(source.resolve()) and not Path(candidate.file).is_absolute()
        if not inside:
            raise Refused("its path leaves the folder")
        if not path.exists():
            raise Refused("no such file")
        if not path.is_file():
            raise Refused("not a file")
        if not path.stat().st_size:
            raise Refused("an empty file")
    except (OSError, ValueError, RuntimeError):
        raise Refused("its path cannot be used") from None
    return path


def resolve_pairs(candidates: Sequence[Candidate], verdicts: Sequence[Verdict]) -> list[Verdict]:
    """The final verdicts: duplicates of earlier clips are refused, pairs of which one view alone is extreme,
    and views whose pair lost its other one.

    A clip whose pair is named once is a single, as declared.
    """
    first: dict[str, str] = {}
    extreme: dict[str, set[bool]] = {}
    for candidate in candidates:
        extreme.setdefault(candidate.pair, set()).add(candidate.kind == EXTREME)
    resolved = []
    for candidate, verdict in zip(candidates, verdicts, strict=True):
        if not verdict.reason and verdict.pictures in first:
            verdict = Verdict(f"a duplicate of {first[verdict.pictures]}")
        elif not verdict.reason and len(extreme[candidate.pair]) > 1:
            verdict = Verdict(f"only one view of its pair is called {EXTREME}")
        first.setdefault(verdict.pictures, candidate.file)
        resolved.append(verdict)
    declared = Counter(candidate.pair for candidate in candidates)
    left = Counter(c.pair for c, verdict in zip(candidates, resolved, strict=True) if not verdict.reason)
    return [
        Verdict("the other view of its pair was refused")
        if not verdict.reason and declared[candidate.pair] > 1 == left[candidate.pair]
        else verdict
        for candidate, verdict in zip(candidates, resolved, strict=True)
    ]


def publish(
    output: Path, folder: Path, candidates: Sequence[Candidate], verdicts: Sequence[Verdict]
) -> tuple[int, int]:
    """Copy the finished clips from ``folder`` and write their tables; refused.csv has file, pair and reason.

    Returns how many were accepted and refused.
    """
    files, rows, refused = [], [], []
    for candidate, verdict in zip(candidates, verdicts, strict=True):
        if verdict.stored is None:
            refused.append((candidate.file, candidate.pair, verdict.reason))
            continue
        files.append(StoredFile(**verdict.stored))
        rows.append({key: getattr(candidate, key) for key in _COLUMNS} | {"file": files[-1].file})
        shutil.copyfile(folder / files[-1].file, output / files[-1].file)
    write_set(output, pd.DataFrame(rows, columns=list(_COLUMNS)), files)
    write_atomically(
        output / "refused.csv", pd.DataFrame(refused, columns=["file", "pair", "reason"]).to_csv(index=False)
    )
    return len(files), len(refused)
