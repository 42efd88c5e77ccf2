"""Data sets: clips with the split of each, and which of the held-out clips are paired."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd

from anyview import paths
from anyview.runtime.errors import AnyviewError
from anyview.video.marks import marks_file, read_marks
from anyview.video.phases import frames_in_step, seconds_of, steps_at
from anyview.video.pictures import resize
from anyview.video.sets import open_frames
from anyview.video.splits import read_split


@dataclass(frozen=True)
class Dataset:
    """Clips and their splits: ``frames`` uint8 (N, T, H, W, 3), ``clips`` one row for each with its split.

    ``marks``, float32 (N, T, M, 2), are the places of M known things in pixels, if the set has any.

    The experts' clips that are paired with the set's own are of the same set, or of the set ``experts``: of
    another body, before another camera and in its own time.
    """

    name: str
    frames: np.ndarray
    clips: pd.DataFrame
    marks: np.ndarray | None = None
    experts: "Dataset | None" = None

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

    def same_choice(self, clips: np.ndarray) -> list[np.ndarray]:
        """``clips`` in groups of what the expert chose to do; in one where there was nothing to choose."""
        if "choice" not in self.clips:
            return [clips]
        choices = self.clips["choice"].to_numpy()[clips]
        return [clips[choices == choice] for choice in np.unique(choices)]

    @cached_property  # training asks at every iteration
    def _splits(self) -> dict[str, np.ndarray]:
        names = self.clips["split"].to_numpy()
        return {name: np.flatnonzero(names == name) for name in np.unique(names)}

    @cached_property
    def views(self) -> list[np.ndarray]:
        """Indices of the clips of each demonstration to train on that several cameras saw."""
        clips = self.clips.reset_index(drop=True).iloc[self.split("train")]
        groups = clips.groupby("pair", sort=False).indices.values()
        return [self.split("train")[group] for group in groups if len(group) > 1]

    def expert_frames(self, clips: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Frames ``times`` of the experts' ``clips``, uint8 (..., H, W, 3), of the size of the set's own."""
        if self.experts is None:
            return self.frames[clips, times]
        return resize(self.experts.frames[clips, times], self.image_size)

    def steps(self, clips: np.ndarray, times: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Which frames of ``others``, the set's own, are as far as the experts' ``clips`` at ``times``."""
        if self.experts is not None:
            return steps_at(self.experts.seconds[clips, times])
        if self.progress is None:
            return times
        return np.abs(self.progress[others] - self.progress[clips, times][..., None]).argmin(axis=-1)

    def expert_clip(self, clip: int, other: int) -> np.ndarray:
        """The experts' ``clip``, uint8 (T, H, W, 3), in step with the own clip ``other`` and of its size."""
        if self.experts is not None:
            return self.experts.in_step(clip, self.image_size)
        times = np.arange(self.length)
        return self.frames[clip, self.steps(np.array(other), times, np.array(clip))]

    def in_step(self, clip: int, size: int) -> np.ndarray:
        """A ``clip`` of the rig in step with simulated ones, uint8 RGB (50, size, size, 3)."""
        return resize(self.frames[clip, frames_in_step(self.seconds[clip])], size)

    @cached_property
    def progress(self) -> np.ndarray | None:
        """How far the script has come at each frame, in its steps (N, T), if clips do not keep its time."""
        return progress_of(self.clips)

    @cached_property
    def seconds(self) -> np.ndarray:
        """When each frame of the rig's clips was taken, (N, T) from the clips' start.

        Of rendered scenes the manifest tells it; ingested clips are taken to last as long as the rig's.
        """
        if "times" in self.clips:
            return np.array([text.split() for text in self.clips["times"]], float)
        return np.broadcast_to(seconds_of(self.length), self.frames.shape[:2])


def progress_of(clips: pd.DataFrame) -> np.ndarray | None:
    """How far the script has come at each frame of a manifest's ``clips``, in its steps (N, T).

    None where all keep its time.
    """
    if "progress" not in clips:
        return None
    return np.array([text.split() for text in clips["progress"]], float)


def open_dataset(name: str, experts: str | None = None) -> Dataset:
    """One of the pipeline's data sets; clips that no split names are left with an empty split.

    ``experts`` names another set for the experts' clips.

    Raises AnyviewError if the split table does not fit the clips, leaves fewer than two clips to train on, or
    none to validate with.
    """
    folder, table = paths.clip_set(name), paths.split_table(name)
    store = open_frames(folder)
    split = read_split(table)
    unknown = split["clip"][~split["clip"].isin(store.manifest["clip"])]
    if len(unknown):
        raise AnyviewError(f"{table}: clip {unknown.iloc[0]} is not in {folder}; run the split stage again")
    clips = store.manifest.drop(columns=["pair", "split"], errors="ignore")
    clips = clips.merge(split, on="clip", how="left").fillna({"pair": "", "split": ""})
    dataset = Dataset(name, store.frames, clips, read_marks(folder, *store.frames.shape[:2]))
    for wanted, least in (("train", 2), ("validation", 1)):
        groups = dataset.same_choice(dataset.split(wanted))
        if min(map(len, groups), default=0) < least:
            of_each = " of each choice" if "choice" in clips else ""
            raise AnyviewError(f"{table}: split {wanted} needs at least {least} clips{of_each}")
    return replace(dataset, experts=open_dataset(experts)) if experts else dataset


def dataset_files(name: str) -> list[Path]:
    """The small files that change whenever a data set does, to key what is made from it."""
    folder, table = paths.clip_set(name), paths.split_table(name)
    return [folder / "manifest.csv", folder / "files.csv", *marks_file(folder), table]


def clip_pairs(dataset: Dataset, split: str) -> list[tuple[int, int]]:
    """(source, target) clips to evaluate a translator on: every clip of ``split`` once as the target.

    The source is the other view of the target's pair, or the next clip of the same choice if it has none. An
    ``extreme`` target's source is a standard validation clip. Other experts' clips are the sources in the
    order of their own ``split``.
    """
    targets = dataset.split(split)
    if dataset.experts:
        shown = dataset.experts.split(split)
        return [(int(shown[n % len(shown)]), int(target)) for n, target in enumerate(targets)]
    if split == "extreme":
        sources = dataset.split("validation")
        if "kind" in dataset.clips:
            standard = (dataset.clips["kind"].iloc[sources] == "standard").to_numpy()
            sources = sources[standard] if standard.any() else sources
        return [(int(sources[n % len(sources)]), int(target)) for n, target in enumerate(targets)]
    pairs = dataset.clips["pair"].to_numpy()
    following = {
        clip: group[(n + 1) % len(group)]
        for group in dataset.same_choice(targets)
        for n, clip in enumerate(group)
    }
    chosen = []
    for target in targets:
        others = [clip for clip in targets if clip != target and pairs[clip] == pairs[target]]
        chosen.append((int(others[0] if others else following[target]), int(target)))
    return chosen
