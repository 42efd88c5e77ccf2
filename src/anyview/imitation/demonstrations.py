"""The demonstrations that agents imitate: the same clips of the validation split for every cell and run."""

from pathlib import Path

import numpy as np

from anyview.clips.splits import read_split
from anyview.clips.store import open_frames
from anyview.config import Params
from anyview.runtime.errors import AnyviewError
from anyview.runtime.seeds import stream

DEMONSTRATIONS = Path("data/sim/diverse")
SPLIT = Path("data/splits/sim-diverse.csv")


def imitated_demonstrations(params: Params) -> tuple[list[str], np.ndarray]:
    """``imitation.reward.demonstrations`` clips: their ids, and their frames, uint8 RGB (m, 50, H, W, 3).

    Raises AnyviewError where the split holds out fewer, or the frames are of another size than the agents'.
    """
    store = open_frames(DEMONSTRATIONS)
    split = read_split(SPLIT)
    held_out = set(split["clip"][split["split"] == "validation"])
    rows = np.flatnonzero(store.manifest["clip"].isin(held_out))
    wanted = params.imitation.reward.demonstrations
    if len(rows) < wanted:
        raise AnyviewError(
            f"params.yaml: imitation.reward.demonstrations: {wanted}, but {SPLIT} holds out {len(rows)} clips"
        )
    made, size = store.frames.shape[2], params.sim.image_size
    if made != size:
        raise AnyviewError(f"{DEMONSTRATIONS}: frames of {made} pixels, but sim.image_size is {size}")
    chosen = np.sort(stream(params.base.seed, "imitated").choice(rows, wanted, replace=False))
    return list(store.manifest["clip"].iloc[chosen]), np.stack([store.frames[row] for row in chosen])
