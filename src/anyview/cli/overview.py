"""What clips there are: raw, finished and refused, by kind and split."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pandas as pd

from anyview import paths
from anyview.config import read_yaml
from anyview.ingest.raw_manifest import read_raw_manifest
from anyview.runtime.errors import AnyviewError
from anyview.video.manifests import KINDS, read_table
from anyview.video.splits import SPLITS, read_split

UNUSED = "unused"
_SHOWN = 20  # refused clips in the text


def survey(source: str, names: Iterable[str]) -> dict[str, Any]:
    """Counts for JSON: raw clips by origin, sets by split, real clips by kind and split, and the refused.

    ``source`` is the origin of the real clips, ``surrogate`` or ``recorded``; ``names`` are the sets'.
    """
    manifests = {origin: paths.raw(origin) / "manifest.csv" for origin in ("surrogate", "recorded")}
    raw = {origin: len(read_raw_manifest(path)) if path.exists() else 0 for origin, path in manifests.items()}
    sets = {name: _by_split(name) for name in names}
    real = paths.clip_set(paths.REAL)
    clips = _split_of(_table(real / "manifest.csv", ["clip", "kind"]), paths.REAL)
    kinds = {kind: _count(clips["split"][clips["kind"] == kind]) for kind in KINDS}
    refused = _table(real / "refused.csv", ["file", "pair", "reason"]).to_dict("records")
    return {"source": source, "raw": raw, "sets": sets, "kinds": kinds, "refused": refused}


def ingested_source() -> str | None:
    """The ``real.source`` that the finished real clips come from: what stage `ingest` was last run with."""
    try:
        return str(read_yaml(Path("dvc.lock"))["stages"]["ingest"]["params"]["params.yaml"]["real.source"])
    except (AnyviewError, KeyError, TypeError):
        return None


def lines(found: dict[str, Any]) -> Iterator[str]:
    """``survey`` as text."""
    columns = (*SPLITS, UNUSED)
    yield f"{'clips':20}{'all':>7}" + "".join(f"{column:>12}" for column in columns)
    for name, counts in {
        **found["sets"],
        **{f"  {kind}": row for kind, row in found["kinds"].items()},
    }.items():
        yield f"{name:20}{sum(counts.values()):7}" + "".join(f"{counts[column]:12}" for column in columns)
    raw = ", ".join(f"{count} {origin}" for origin, count in found["raw"].items())
    yield f"raw clips: {raw}; the real ones above are {found['source']}"
    yield f"refused: {len(found['refused'])}"
    for row in found["refused"][:_SHOWN]:
        yield f"  {row['file']}: {row['reason']} (pair {row['pair']})"
    if len(found["refused"]) > _SHOWN:
        yield f"  and more: see {paths.clip_set(paths.REAL) / 'refused.csv'}"


def _table(path: Path, columns: list[str]) -> pd.DataFrame:
    return read_table(path, columns) if path.exists() else pd.DataFrame(columns=columns)


def _by_split(name: str) -> dict[str, int]:
    return _count(_split_of(_table(paths.clip_set(name) / "manifest.csv", ["clip"]), name)["split"])


def _split_of(clips: pd.DataFrame, name: str) -> pd.DataFrame:
    """``clips`` with a column ``split``; before `split` has run, all are unused."""
    path = paths.split_table(name)
    place = read_split(path).set_index("clip")["split"] if path.exists() else pd.Series(dtype=str)
    return clips.assign(split=clips["clip"].map(place).fillna(UNUSED))


def _count(splits: pd.Series) -> dict[str, int]:
    counts = splits.value_counts()
    return {split: int(counts.get(split, 0)) for split in (*SPLITS, UNUSED)}
