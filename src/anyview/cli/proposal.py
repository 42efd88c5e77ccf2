"""A manifest proposed for raw clips, with start and end of each demonstration, and a sheet to check it by."""

from pathlib import Path

import numpy as np
import pandas as pd

from anyview.config import Ingest
from anyview.ingest.motion import propose_stretches
from anyview.ingest.normalize import Refused, parse_stretch, read_clip
from anyview.ingest.raw_manifest import read_raw_manifest
from anyview.runtime.errors import AnyviewError
from anyview.runtime.outputs import write_atomically
from anyview.runtime.workers import run_tasks
from anyview.video.manifests import propose_manifest
from anyview.video.pictures import contact_sheet, write_png


def propose(folder: Path, limits: Ingest) -> tuple[pd.DataFrame, dict[str, str]]:
    """Write ``manifest.proposed.csv`` into a folder of raw clips, and the sheet ``manifest.proposed.png``.

    Rows of a manifest that is there are kept, and so are a start and an end in it. The sheet shows the first,
    the middle and the last picture of each clip as ingest would take it. Returns the rows, and by file why a
    clip has no start and end, or would be refused.
    """
    path = folder / "manifest.csv"
    manifest = read_raw_manifest(path) if path.exists() else propose_manifest(folder)
    if manifest.empty:
        raise AnyviewError(f"{folder}: no video files; fill it with `anyview record` or your own clips")
    table, reasons = propose_stretches(folder, manifest)
    write_atomically(folder / "manifest.proposed.csv", table.to_csv(index=False))
    rows = [row for row in table.to_dict("records") if row["start"] and row["file"] not in reasons]
    tasks = [(folder / row["file"], limits, row["start"], row["end"]) for row in rows]
    shown: list[np.ndarray] = []
    labels: list[str] = []
    for row, clip in zip(rows, run_tasks(_clip_or_reason, tasks), strict=True):
        if isinstance(clip, str):
            reasons[row["file"]] = clip
        else:
            shown.append(clip)
            labels.append(f"{row['file']} {row['start']} to {row['end']} s")
    if shown:
        write_png(folder / "manifest.proposed.png", contact_sheet(shown, labels, moments=3))
    return table, reasons


def _clip_or_reason(path: Path, limits: Ingest, start: str, end: str) -> np.ndarray | str:
    try:
        return read_clip(path, limits, parse_stretch(start, end))
    except Refused as refused:
        return str(refused)
