"""The clips of the expert: those that agents imitate, and those that discriminators learn from."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from anyview import paths
from anyview.config import Params
from anyview.pusher.contexts import COLOURS, Colour, Context
from anyview.pusher.kinematics import wrap
from anyview.runtime.errors import AnyviewError
from anyview.seeds import stream
from anyview.video.datasets import open_dataset
from anyview.video.sets import FrameStore, open_frames
from anyview.video.splits import read_split


class Clips(NamedTuple):
    """Clips of the expert: ids, and frames (m, 50, H, W, 3), or (R, m, 50, H, W, 3) of R contexts' own."""

    names: list[str]
    frames: np.ndarray


def imitated_demonstrations(params: Params, choice: Colour | None = None) -> Clips:
    """Clips of the validation split, the same for every cell and run; with ``choice`` of that choice.

    Raises AnyviewError where the split holds out fewer, or the frames are of another size than the agents'.
    """
    store, rows = _split_rows(params, "validation", choice)
    return _draw(params, store, rows, params.imitation.demonstrations, "imitated", f"holds out {len(rows)}")


def rig_demonstrations(params: Params, experts: str) -> Clips:
    """As ``imitated_demonstrations``, of the rig's set ``experts``, in step with simulated clips.

    Raises AnyviewError where its split holds out fewer.
    """
    dataset, wanted = open_dataset(experts), params.imitation.demonstrations
    rows = dataset.split("validation")
    if len(rows) < wanted:
        held_out = f"{paths.split_table(experts)} holds out {len(rows)} clips"
        raise AnyviewError(f"params.yaml: imitation.demonstrations: {wanted}, but {held_out}")
    chosen = np.sort(stream(params.base.seed, "imitated").choice(rows, wanted, replace=False))
    frames = [dataset.in_step(row, params.sim.image_size) for row in chosen]
    return Clips(list(dataset.clips["clip"].iloc[chosen]), np.stack(frames))


def own_demonstrations(params: Params, contexts: int, choice: Colour | None = None) -> Clips:
    """As ``imitated_demonstrations``, with other clips in each of ``contexts``; ids context by context.

    Fewer clips of a context are the first of more.
    """
    store, rows = _split_rows(params, "validation", choice)
    orders = [stream(params.base.seed, "imitated", context).permutation(rows) for context in range(contexts)]
    return _first_of(params, store, orders)


def angled_demonstrations(
    params: Params, contexts: Sequence[Context], angle: float, choice: Colour | None = None
) -> Clips:
    """As ``own_demonstrations``: those whose cameras are nearest to ``angle`` degrees from the context's."""
    store, rows = _split_rows(params, "validation", choice)
    filmed = np.array([context.azimuth for context in _contexts(params, store, rows)])
    beside = [np.abs(wrap(filmed - context.azimuth)) for context in contexts]
    orders = [rows[np.abs(each - np.deg2rad(angle)).argsort(kind="stable")] for each in beside]
    return _first_of(params, store, orders)


def clock_clips(params: Params) -> Clips:
    """Clips of the training split, evenly of each choice where there is one: their mean tells the time alone.

    Raises AnyviewError where the split has fewer, or the frames are of another size than the agents'.
    """
    choices = COLOURS if two_goals(params) else (None,)
    parts = []
    for choice in choices:
        store, rows = _split_rows(params, "train", choice)
        wanted = -(-params.imitation.demonstrations // len(choices))
        parts.append(_draw(params, store, rows, wanted, "clock", f"trains on {len(rows)}"))
    names = [name for part in parts for name in part.names]
    return Clips(names, np.concatenate([part.frames for part in parts]))


def two_goals(params: Params) -> bool:
    """Whether the demonstrations choose between two goals."""
    return params.demonstration_sets[params.imitation.dataset].contexts == "choice"


def training_clips(params: Params) -> tuple[np.ndarray, np.ndarray, list[Context]]:
    """The training split: frames (N, 50, H, W, 3) of all clips, a memory map; rows of the split's; contexts.

    Raises AnyviewError where the frames are of another size than the agents'.
    """
    store, rows = _split_rows(params, "train")
    return store.frames, rows, _contexts(params, store, rows)


def _contexts(params: Params, store: FrameStore, rows: np.ndarray) -> list[Context]:
    """Of the clips ``rows``. Raises AnyviewError if the manifest does not tell."""
    if "context" not in store.manifest:
        manifest = paths.clip_set(params.imitation.dataset) / "manifest.csv"
        raise AnyviewError(f"{manifest}: no column context; run the simulate stage again")
    return [Context.from_json(text) for text in store.manifest["context"].iloc[rows]]


def _first_of(params: Params, store: FrameStore, orders: Sequence[np.ndarray]) -> Clips:
    """As many clips as are wanted of each context's order of rows, which must have them."""
    wanted = params.imitation.demonstrations
    _check_count(params, orders[0], wanted, f"holds out {len(orders[0])}")
    chosen = np.stack(orders)[:, :wanted]
    frames = np.stack([store.frames[row] for row in chosen.flat])
    return Clips(
        list(store.manifest["clip"].iloc[chosen.flat]), frames.reshape(*chosen.shape, *frames.shape[1:])
    )


def _draw(
    params: Params, store: FrameStore, rows: np.ndarray, wanted: int, name: str, there_are: str
) -> Clips:
    _check_count(params, rows, wanted, there_are)
    chosen = np.sort(stream(params.base.seed, name).choice(rows, wanted, replace=False))
    return Clips(list(store.manifest["clip"].iloc[chosen]), np.stack([store.frames[row] for row in chosen]))


def _check_count(params: Params, rows: np.ndarray, wanted: int, there_are: str) -> None:
    if len(rows) < wanted:
        table = paths.split_table(params.imitation.dataset)
        raise AnyviewError(f"params.yaml: imitation.demonstrations: {wanted}, but {table} {there_are} clips")


def _split_rows(params: Params, split: str, choice: Colour | None = None) -> tuple[FrameStore, np.ndarray]:
    folder = paths.clip_set(params.imitation.dataset)
    store = open_frames(folder)
    made, size = store.frames.shape[2], params.sim.image_size
    if made != size:
        raise AnyviewError(f"{folder}: frames of {made} pixels, but sim.image_size is {size}")
    table = read_split(paths.split_table(params.imitation.dataset))
    members = set(table["clip"][table["split"] == split])
    wanted = store.manifest["clip"].isin(members)
    if choice is not None:
        wanted &= store.manifest["choice"] == choice
    return store, np.flatnonzero(wanted)
