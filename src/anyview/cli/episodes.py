"""Demonstrations between the sets of this project and LeRobotDatasets."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from anyview.ingest.raw_manifest import read_raw_manifest
from anyview.lerobot.reading import episode_views
from anyview.lerobot.writing import write_dataset
from anyview.runtime.errors import AnyviewError
from anyview.runtime.outputs import whole_folder, write_atomically
from anyview.runtime.progress import track
from anyview.video.manifests import read_table
from anyview.video.reading import open_video
from anyview.video.sets import open_frames


def list_episodes(raw: Path, dataset: Path, cameras: Sequence[str]) -> pd.DataFrame:
    """Add what ``cameras`` saw of a LeRobotDataset to ``raw/manifest.csv``; returns the new rows.

    The data set must lie in ``raw``: ingest takes no clips from elsewhere.
    """
    views = episode_views(dataset, cameras)
    if not dataset.resolve().is_relative_to(raw.resolve()):
        raise AnyviewError(
            f"{dataset}: lies outside of {raw}, where ingest looks; move it there, or give --raw"
        )
    views["file"] = [
        (dataset.resolve() / file).relative_to(raw.resolve()).as_posix() for file in views["file"]
    ]
    path = raw / "manifest.csv"
    manifest = read_raw_manifest(path) if path.exists() else views.head(0)
    listed = views["file"][views["file"].isin(manifest["file"])]
    if len(listed):
        raise AnyviewError(f"{path}: it lists {listed.iloc[0]} already; delete its rows first")
    write_atomically(path, pd.concat([manifest, views]).fillna("").to_csv(index=False))
    return views


def export_set(folder: Path, output: Path, cameras: Sequence[str], task: str) -> tuple[int, int]:
    """Write a set of clips as a LeRobotDataset: an episode is a demonstration, as all ``cameras`` saw it.

    Without ``cameras`` these are all of the set's. Returns how many demonstrations were written, and how many
    were left out because a camera did not see them.
    """
    if output.exists():
        raise AnyviewError(f"{output}: exists already; name a new folder")
    store = open_frames(folder)
    episodes, names = _episodes(folder, store.manifest, cameras)
    written = episodes.dropna().astype(int).to_numpy()
    if not len(written):
        raise AnyviewError(
            f"{folder}: no demonstration was seen by all of {', '.join(names)}; choose one with --camera"
        )
    first = read_table(folder / "files.csv", ["file"])["file"].iloc[0]
    with open_video(folder / first) as video:
        rate = video.rate
    with whole_folder(output) as partial, track("export", written.size) as progress:
        write_dataset(partial, store.frames, written, names, rate, task, progress.advance)
    return len(written), len(episodes) - len(written)


def _episodes(folder: Path, manifest: pd.DataFrame, cameras: Sequence[str]) -> tuple[pd.DataFrame, list[str]]:
    """The clip of each demonstration (row) by each camera (column), none where it has no such view."""
    clips = pd.DataFrame(
        {"pair": manifest["clip"], "camera": ""}
        | {column: manifest[column] for column in ("pair", "camera") if column in manifest}
    )
    clips["camera"] = clips["camera"].str.replace(r"[^\w.-]+", "-", regex=True).replace("", "view")
    doubled = clips[clips.duplicated()]
    if len(doubled):
        pair, camera = doubled.iloc[0]
        raise AnyviewError(f"{folder / 'manifest.csv'}: pair {pair} has two clips of camera {camera}")
    names = list(dict.fromkeys(cameras)) or list(clips["camera"].unique())
    for name in names:
        if name not in set(clips["camera"]):
            raise AnyviewError(f"{folder}: no camera {name}; it has {', '.join(clips['camera'].unique())}")
    places = clips.assign(place=np.arange(len(clips))).pivot(index="pair", columns="camera", values="place")
    return places.reindex(index=clips["pair"].unique(), columns=names), names
