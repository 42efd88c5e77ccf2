"""Splits: which clips train, which validate, and which are the extreme ones.

The two views of one demonstration, a pair, always stay together.
"""

import hashlib
from pathlib import Path

import pandas as pd

from anyview.runtime.errors import AnyviewError
from anyview.video.manifests import KINDS, read_table

SPLITS = ("train", "validation", "extreme")


def split_pairs(clips: pd.DataFrame, seed: int, train: float, validation: float) -> pd.DataFrame:
    """Assign clips to splits; returns a table ``clip, pair, split`` in the order of ``clips``.

    ``clips`` has columns ``clip``, ``pair`` and ``kind``. Clips of kind ``extreme_distractor`` are
    ``extreme``. The other pairs are ranked by a hash of ``seed`` and the pair's id; validation takes the
    first ones that fit its share, train the next ones. So a clip that is added moves others only where it
    displaces them. The first pair of each kind ranks before all others, ``standard`` first: validation
    sees every kind that it has room for.

    ``train`` and ``validation`` are counts of clips, or fractions where below 1. Counts that the clips cannot
    fill are taken as proportions; clips beyond both counts are left out. Raises AnyviewError when train or
    validation would be empty.
    """
    extreme = clips["kind"] == "extreme_distractor"
    ordinary = clips[~extreme]
    place = dict.fromkeys(clips["pair"][extreme], "extreme")
    straddling = ordinary["pair"].isin(place)
    if straddling.any():
        raise AnyviewError(
            f"pair {ordinary['pair'][straddling].iloc[0]}: only one of its clips is extreme_distractor"
        )
    sizes = ordinary.groupby("pair")["clip"].size()
    ranked = _ranked(ordinary, seed)
    left = _clip_counts(len(ordinary), train, validation, least=sizes[ranked[0]] if ranked else 0)
    for pair in ranked:
        split = next((split for split in left if sizes[pair] <= left[split]), None)
        if split is not None:
            left[split] -= sizes[pair]
            place[pair] = split
    for split in left:
        if split not in place.values():
            raise AnyviewError(
                f"{len(ordinary)} clips in {len(sizes)} pairs leave none for {split}; add clips"
            )
    table = pd.DataFrame({"clip": clips["clip"], "pair": clips["pair"], "split": clips["pair"].map(place)})
    return table[table["split"].notna()].reset_index(drop=True)


def _clip_counts(total: int, train: float, validation: float, least: int) -> dict[str, int]:
    """Clips for validation and for training out of ``total``; a share of validation is at least ``least``."""
    if train >= 1 and validation >= 1:
        if train + validation <= total:
            return {"validation": int(validation), "train": int(train)}
        train, validation = train / (train + validation), validation / (train + validation)
    held_out = int(validation) if validation >= 1 else max(round(validation * total), least)
    wanted = int(train) if train >= 1 else round(train * total)
    return {"validation": held_out, "train": min(wanted, total - held_out)}


def _ranked(clips: pd.DataFrame, seed: int) -> list[str]:
    pairs = clips.drop_duplicates("pair")[["pair", "kind"]].copy()
    pairs["hash"] = [hashlib.sha256(f"{seed}/{pair}".encode()).hexdigest() for pair in pairs["pair"]]
    pairs = pairs.sort_values("hash", kind="stable")
    later = pairs.duplicated("kind")
    first = pairs[~later].sort_values("kind", key=lambda kinds: kinds.map(KINDS.index))
    return [*first["pair"], *pairs["pair"][later]]


def read_split(path: Path) -> pd.DataFrame:
    """Read a split table: columns ``clip, pair, split``; raises AnyviewError naming the file."""
    table = read_table(path, ["clip", "pair", "split"], unique="clip")
    unknown = table["split"][~table["split"].isin(SPLITS)]
    if len(unknown):
        raise AnyviewError(f"{path}: split {unknown.iloc[0]!r} is none of {', '.join(SPLITS)}")
    return table
