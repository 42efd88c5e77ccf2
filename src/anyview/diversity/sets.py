"""Sets that show the demonstrations of another from fewer sides, without distractors, or fewer of them."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from anyview import paths
from anyview.pusher.contexts import Context
from anyview.pusher.kinematics import wrap
from anyview.pusher.proposals import DECIMALS
from anyview.runtime.errors import AnyviewError
from anyview.seeds import stream
from anyview.video.datasets import Dataset


def restrict(context: Context, views: int | None, distractors: bool) -> Context:
    """``context`` seen from the nearest of ``views`` azimuths, evenly spread from 0 on; None leaves its own.

    Its distractors go unless ``distractors``. Everything else stays, so the expert does the same in both.
    """
    azimuth = context.azimuth
    if views is not None:
        apart = 2 * np.pi / views
        azimuth = float(wrap(np.asarray(round(azimuth / apart) % views * apart)).round(DECIMALS))
    return replace(context, azimuth=azimuth, distractors=context.distractors if distractors else ())


def restriction(views: str, clutter: str) -> Callable[[Context], Context]:
    """``restrict`` as the name of a set says it: see ``paths.restricted_set``."""
    count = None if views == paths.ANY_VIEW else int(views)
    return partial(restrict, views=count, distractors=clutter == "distractors")


def chosen(total: int, count: int, seed: int) -> np.ndarray:
    """Which ``count`` of ``total`` demonstrations a training of ``seed`` learns from: (total,) bool.

    More of them hold all of fewer. Those of different seeds differ: which ones they are is luck as well.
    """
    mask = np.zeros(total, bool)
    mask[stream(seed, "demonstrations").permutation(total)[:count]] = True
    return mask


def some_demonstrations(dataset: Dataset, count: int, seed: int) -> Dataset:
    """``dataset`` with the split of the ``chosen`` clips alone: nothing of the others is learned.

    Raises AnyviewError if it has fewer, or these leave fewer than two to train on, or none to validate with.
    """
    if count > len(dataset.clips):
        has = f"{dataset.name} has {len(dataset.clips)}"
        raise AnyviewError(f"params.yaml: evidence.diversity.demonstrations: {count}, but {has}")
    kept = chosen(len(dataset.clips), count, seed)
    some = replace(dataset, clips=dataset.clips.assign(split=dataset.clips["split"].where(kept, "")))
    if len(some.split("train")) < 2 or not len(some.split("validation")):
        raise AnyviewError(
            f"params.yaml: evidence.diversity.demonstrations: {count} of {dataset.name} leave none to train "
            "on, or none to validate with"
        )
    return some
