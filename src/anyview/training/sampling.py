"""Time-paired frames of two clips, to learn from, and the fixed pairs of clips that judge a translator."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import pandas as pd

from anyview import paths
from anyview.runtime.errors import AnyviewError
from anyview.video.sets import open_frames
from anyview.video.splits import read_split


@dataclass(frozen=True)
class Dataset:
    """Clips and their splits: ``frames`` uint8 (N, T, H, W, 3), ``clips`` one row for each with its split."""

    name: str
    frames: np.ndarray
    clips: pd.DataFrame

    @property
    def length(self) -> int:
        """Frames of a clip."""
        return self.frames.shape[1]

    @property
    def image_size(self) -> int:
        """Height and width of a frame."""
        return self.frames.shape[2]

    def split(self, name: str) -> np.ndarray:
        """Indices of the clips of a split, in the order of the manifest."""
        return self._splits.get(name, np.empty(0, int))

    @cached_property  # training asks at every iteration
    def _splits(self) -> dict[str, np.ndarray]:
        names = self.clips["split"].to_numpy()
        return {name: np.flatnonzero(names == name) for name in np.unique(names)}


@dataclass(frozen=True)
class FramePairs:
    """Frame ``times`` of clips ``sources`` (i) and ``targets`` (j), all three (N,)."""

    sources: np.ndarray
    targets: np.ndarray
    times: np.ndarray

    def __len__(self) -> int:
        return len(self.times)

    def parts(self, count: int) -> list["FramePairs"]:
        """The pairs in ``count`` runs of about equal length, fewer where there are fewer pairs."""
        bounds = np.linspace(0, len(self), min(count, len(self)) + 1).round().astype(int)
        return [
            FramePairs(self.sources[a:b], self.targets[a:b], self.times[a:b]) for a, b in pairwise(bounds)
        ]

    def frames(self, dataset: Dataset) -> tuple[np.ndarray, np.ndarray]:
        """o_t^i and after them o_t^j, uint8 (2N, H, W, 3), and o_0^j, (N, H, W, 3)."""
        clips, times = np.concatenate((self.sources, self.targets)), np.tile(self.times, 2)
        return dataset.frames[clips, times], dataset.frames[self.targets, 0]


def open_dataset(name: str) -> Dataset:
    """Open one of the pipeline's datasets; clips that no split names are left with an empty split."""
    folder, table = paths.clip_set(name), paths.split_table(name)
    store = open_frames(folder)
    split = read_split(table)
    unknown = split["clip"][~split["clip"].isin(store.manifest["clip"])]
    if len(unknown):
        raise AnyviewError(f"{table}: clip {unknown.iloc[0]} is not in {folder}; run the split stage again")
    clips = store.manifest.drop(columns=["pair", "split"], errors="ignore")
    clips = clips.merge(split, on="clip", how="left").fillna({"pair": "", "split": ""})
    dataset = Dataset(name, store.frames, clips)
    for wanted, least in (("train", 2), ("validation", 1)):
        if len(dataset.split(wanted)) < least:
            raise AnyviewError(f"{table}: split {wanted} needs at least {least} clips")
    return dataset


def training_pairs(dataset: Dataset, rng: np.random.Generator, count: int) -> FramePairs:
    """``count`` pairs: any two different clips of the training split, at the same random time."""
    clips = dataset.split("train")
    sources = rng.integers(len(clips), size=count)
    targets = (sources + rng.integers(1, len(clips), size=count)) % len(clips)
    times = rng.integers(dataset.length, size=count)
    return FramePairs(clips[sources], clips[targets], times)


def clip_pairs(dataset: Dataset, split: str) -> list[tuple[int, int]]:
    """(source, target) clips that judge a translator: every clip of ``split`` once as the target.

    The source is the other view of the target's pair, or the next clip where it has none. An ``extreme``
    target's source is a standard validation clip.
    """
    targets = dataset.split(split)
    if split == "extreme":
        sources = dataset.split("validation")
        if "kind" in dataset.clips:
            standard = (dataset.clips["kind"].iloc[sources] == "standard").to_numpy()
            sources = sources[standard] if standard.any() else sources
        return [(int(sources[n % len(sources)]), int(target)) for n, target in enumerate(targets)]
    pairs = dataset.clips["pair"].to_numpy()
    chosen = []
    for n, target in enumerate(targets):
        others = [clip for clip in targets if clip != target and pairs[clip] == pairs[target]]
        chosen.append((int(others[0] if others else targets[(n + 1) % len(targets)]), int(target)))
    return chosen


def validation_pairs(dataset: Dataset, rng: np.random.Generator, count: int) -> FramePairs:
    """``count`` fixed frame pairs: the validation clips' pairs in turn, each at a random time."""
    pairs = np.array(clip_pairs(dataset, "validation"))
    chosen = pairs[np.arange(count) % len(pairs)]
    return FramePairs(chosen[:, 0], chosen[:, 1], rng.integers(dataset.length, size=count))
