"""The clips of the expert: those that agents imitate, and those that discriminators learn from."""

import numpy as np

from anyview import paths
from anyview.config import Params
from anyview.pusher.contexts import Context
from anyview.runtime.errors import AnyviewError
from anyview.seeds import stream
from anyview.video.sets import FrameStore, open_frames
from anyview.video.splits import read_split


def imitated_demonstrations(params: Params) -> tuple[list[str], np.ndarray]:
    """Clips of the validation split, the same for every cell and run: ids, and frames (m, 50, H, W, 3).

    Raises AnyviewError where the split holds out fewer, or the frames are of another size than the agents'.
    """
    store, rows = _split_rows(params, "validation")
    wanted = params.imitation.demonstrations
    if len(rows) < wanted:
        table = paths.split_table(params.imitation.dataset)
        raise AnyviewError(
            f"params.yaml: imitation.demonstrations: {wanted}, but {table} holds out {len(rows)} clips"
        )
    chosen = np.sort(stream(params.base.seed, "imitated").choice(rows, wanted, replace=False))
    return list(store.manifest["clip"].iloc[chosen]), np.stack([store.frames[row] for row in chosen])


def training_clips(params: Params) -> tuple[np.ndarray, np.ndarray, list[Context]]:
    """The training split: frames (N, 50, H, W, 3) of all clips, a memory map; rows of the split's; contexts.

    Raises AnyviewError where the frames are of another size than the agents'.
    """
    store, rows = _split_rows(params, "train")
    if "context" not in store.manifest:
        manifest = paths.clip_set(params.imitation.dataset) / "manifest.csv"
        raise AnyviewError(f"{manifest}: no column context; run the simulate stage again")
    return store.frames, rows, [Context.from_json(text) for text in store.manifest["context"].iloc[rows]]


def _split_rows(params: Params, split: str) -> tuple[FrameStore, np.ndarray]:
    folder = paths.clip_set(params.imitation.dataset)
    store = open_frames(folder)
    made, size = store.frames.shape[2], params.sim.image_size
    if made != size:
        raise AnyviewError(f"{folder}: frames of {made} pixels, but sim.image_size is {size}")
    table = read_split(paths.split_table(params.imitation.dataset))
    members = set(table["clip"][table["split"] == split])
    return store, np.flatnonzero(store.manifest["clip"].isin(members))
