"""Batches to learn from: two clips' frames of the same times, the pairs drawn from streams of their own."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from anyview.runtime.errors import AnyviewError
from anyview.video.datasets import Dataset, clip_pairs


@dataclass(frozen=True)
class FramePairs:
    """Frames ``times`` of clips ``sources`` (i) and ``targets`` (j): N pairs, of one frame each or of K.

    ``times`` are i's. Where j's are others, since i are of another set or clips differ in tempo, the data set
    tells which of j's frames are as far.
    ``sources`` and ``targets`` are (N,) and ``times`` is (N,), or all three are (N, 1), (N, 1) and (N, K).
    """

    sources: np.ndarray
    targets: np.ndarray
    times: np.ndarray

    def __len__(self) -> int:
        return len(self.times)

    def parts(self, count: int) -> list["FramePairs"]:
        """The pairs in ``even_parts``."""
        return [
            FramePairs(self.sources[part], self.targets[part], self.times[part])
            for part in even_parts(len(self), count)
        ]

    def frames(self, dataset: Dataset) -> np.ndarray:
        """o_t^i and after them o_t^j, uint8 (2N, H, W, 3) or (2N, K, H, W, 3)."""
        steps = dataset.steps(self.sources, self.times, self.targets)
        shown = dataset.expert_frames(self.sources, self.times)
        return np.concatenate((shown, dataset.frames[self.targets, steps]))

    def clips(self, dataset: Dataset, times: np.ndarray) -> np.ndarray:
        """Frames ``times`` (K,) of the clips i, uint8 (N, K, H, W, 3); of pairs of one frame each."""
        return dataset.expert_frames(self.sources[:, None], times)

    def marks(self, dataset: Dataset) -> tuple[np.ndarray, np.ndarray] | None:
        """The marks of ``frames`` (2N, M, 2) and of ``contexts`` (N, M, 2), in pixels, if the set has any.

        Marks of other experts' clips are NaN if their set has none.
        """
        if dataset.marks is None:
            return None
        steps = dataset.steps(self.sources, self.times, self.targets)
        of_targets = dataset.marks[self.targets, steps]
        experts = dataset.experts or dataset
        if experts.marks is None:
            of_experts = np.full_like(of_targets, np.nan)
        else:
            of_experts = experts.marks[self.sources, self.times]
            if experts.image_size != dataset.image_size:
                of_experts = dataset.image_size / experts.image_size * (of_experts + 0.5) - 0.5
        return np.concatenate((of_experts, of_targets)), dataset.marks[self.targets, 0]

    def contexts(self, dataset: Dataset) -> np.ndarray:
        """o_0^j, uint8 (N, H, W, 3); of pairs of one frame each."""
        return dataset.frames[self.targets, 0]


def even_parts(length: int, count: int) -> list[slice]:
    """``count`` runs of about equal length that make up ``length``, no run empty: fewer if it is less."""
    bounds = np.linspace(0, length, min(count, length) + 1).round().astype(int)
    return [slice(a, b) for a, b in pairwise(bounds)]


def training_pairs(dataset: Dataset, rng: np.random.Generator, count: int) -> FramePairs:
    """``count`` pairs: any two different clips of the training split and of one choice, at a random time.

    Other experts' clips are paired with any of the set's own.
    """
    if dataset.experts:
        shown, own = dataset.experts.split("train"), dataset.split("train")
        times = rng.integers(dataset.experts.length, size=count)
        return FramePairs(rng.choice(shown, count), rng.choice(own, count), times)
    groups = dataset.same_choice(dataset.split("train"))
    clips, sizes = np.concatenate(groups), [len(group) for group in groups]
    # Of each clip: where its group starts among ``clips``, and the size of its group.
    start, size = np.repeat(np.cumsum([0, *sizes[:-1]]), sizes), np.repeat(sizes, sizes)
    sources = rng.integers(len(clips), size=count)
    further = (rng.integers(1, len(clips), size=count) - 1) % (size[sources] - 1) + 1
    targets = start[sources] + (sources - start[sources] + further) % size[sources]
    times = rng.integers(dataset.length, size=count)
    return FramePairs(clips[sources], clips[targets], times)


def training_views(dataset: Dataset, rng: np.random.Generator, count: int) -> FramePairs:
    """``count`` pairs: two views of one demonstration of the training split, at the same random time.

    Raises AnyviewError if every demonstration was seen by one camera alone.
    """
    views = dataset.views
    if not views:
        raise AnyviewError(f"data set {dataset.name}: no demonstration to train on has a second view")
    chosen = [rng.choice(views[n], 2, replace=False) for n in rng.integers(len(views), size=count)]
    sources, targets = np.array(chosen).T
    return FramePairs(sources, targets, rng.integers(dataset.length, size=count))


def validation_pairs(dataset: Dataset, rng: np.random.Generator, count: int) -> FramePairs:
    """``count`` fixed frame pairs: the validation clips' pairs in turn, each at a random time."""
    pairs = np.array(clip_pairs(dataset, "validation"))
    chosen = pairs[np.arange(count) % len(pairs)]
    length = (dataset.experts or dataset).length
    return FramePairs(chosen[:, 0], chosen[:, 1], rng.integers(length, size=count))


def training_triplets(dataset: Dataset, rng: np.random.Generator, count: int, times: int) -> FramePairs:
    """``count`` pairs of different training clips at ``times`` different random times each.

    A triplet is a frame of one clip, and two of the other clip: of the same time, and of another time.
    """
    clips = dataset.split("train")
    chosen = np.stack([rng.choice(clips, 2, replace=False) for _ in range(count)])
    drawn = np.stack([rng.permutation(dataset.length)[:times] for _ in range(count)])
    return FramePairs(chosen[:, :1], chosen[:, 1:], drawn)


def validation_triplets(dataset: Dataset, count: int) -> FramePairs:
    """The first ``count`` pairs of validation clips, all their frames."""
    chosen = np.array(clip_pairs(dataset, "validation")[:count])
    times = np.broadcast_to(np.arange(dataset.length), (len(chosen), dataset.length))
    return FramePairs(chosen[:, :1], chosen[:, 1:], times)
