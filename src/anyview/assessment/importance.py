"""Which frames of the expert's clip matter: permutation importance (figure 15)."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pandas as pd
import torch

from anyview.runtime.device import worker_count
from anyview.translator.architectures import Translator, embed_task
from anyview.translator.losses import FRAME_SCALE
from anyview.video.datasets import Dataset
from anyview.video.pixels import to_input

_CLIPS = 20


def feature_weights(
    model: Translator,
    dataset: Dataset,
    pairs: list[tuple[int, int]],
    permutations: int,
    rng: np.random.Generator,
) -> pd.DataFrame:
    """Columns ``frame``, ``rise`` and ``weight`` for the frames of the expert's clip.

    The rise of frame t is the mean rise of L_tr when o_t^i is replaced by frames of ``permutations`` other
    times, over at most 20 ``pairs`` (source, target) of clips. The weight is the rise with negatives clipped
    to 0, as a fraction of the sum; if no rise is above 0 every weight is the same.
    """
    offsets = 1 + rng.permutation(dataset.length - 1)[:permutations]
    with ThreadPoolExecutor(worker_count()) as pool:
        rises = list(pool.map(lambda pair: _rises(model, dataset, pair, offsets), pairs[:_CLIPS]))
    rise = np.mean(rises, axis=0)
    positive = np.maximum(rise, 0)
    weight = positive / positive.sum() if positive.any() else np.full(len(rise), 1 / len(rise))
    return pd.DataFrame({"frame": np.arange(len(rise)), "rise": rise, "weight": weight})


@torch.inference_mode()
def _rises(model: Translator, dataset: Dataset, pair: tuple[int, int], offsets: np.ndarray) -> np.ndarray:
    """Mean rise of L_tr (T,) when each frame is replaced by the ones ``offsets`` later, around the end."""
    device = next(model.parameters()).device
    source, target = pair
    clips = dataset.expert_clip(source, target), dataset.frames[target]
    expert, true = (to_input(clip).to(device) for clip in clips)
    z1 = model.encode_expert(expert)
    task = embed_task(model, z1)  # of the clip as it is: a frame is replaced where T reads its time step
    z2, skips = model.encode_context(true[:1])
    skip_terms = model.decoder.skip_terms(skips)

    def losses(features: torch.Tensor) -> torch.Tensor:
        translated = model.decoder(model.translate(features, z2, task), skip_terms)
        return FRAME_SCALE * (translated - true).square().sum((1, 2, 3))

    replaced = torch.stack([losses(z1.roll(-int(offset), dims=0)) for offset in offsets])
    return (replaced.mean(0) - losses(z1)).cpu().double().numpy()
