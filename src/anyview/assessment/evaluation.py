"""What a trained translator makes of held-out clips: losses, likeness, pictures."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import torch

from anyview.assessment.importance import feature_weights
from anyview.assessment.similarity import psnr, ssim
from anyview.assessment.yardsticks import yardsticks
from anyview.config import Assessment
from anyview.runtime.device import torch_device, use_threads, worker_count
from anyview.runtime.progress import track
from anyview.translator.architectures import Translator, embed_task
from anyview.translator.losses import NAMES, alignment_loss, frame_loss
from anyview.video.datasets import Dataset, clip_pairs
from anyview.video.files import write_video
from anyview.video.pictures import write_png
from anyview.video.pixels import to_frames, to_input

_RATE = 10.0  # frames per second of the clips that are written
_STRIP_STEP = 7


@dataclass(frozen=True)
class ClipEvaluation:
    """A translated clip: its row of ``clips.csv``; true beside translated frames, uint8 (T, H, 2 W, 3)."""

    row: dict[str, str | float]
    frames: np.ndarray


@torch.inference_mode()
def translate_clip(model: Translator, clip: np.ndarray, context: np.ndarray) -> np.ndarray:
    """``clip``, uint8 (T, H, W, 3), as the context of the frame ``context`` (H, W, 3) would show it."""
    device = next(model.parameters()).device
    z2, skips = model.encode_context(to_input(context[None]).to(device))
    parts = np.array_split(clip, -(-len(clip) // 64))
    encoded = [model.encode_expert(to_input(frames).to(device)) for frames in parts]
    task = embed_task(model, torch.cat(encoded))
    return np.concatenate([to_frames(model.decode(model.translate(z1, z2, task), skips)) for z1 in encoded])


@torch.inference_mode()
def evaluate_clip(model: Translator, dataset: Dataset, source: int, target: int) -> ClipEvaluation:
    """Translate clip ``source`` to the context of clip ``target`` and compare with what happened there.

    Losses are on the thesis's scale, means over the clip's frames, all weights 1; ``last_frame`` is L_tr of
    the last frame alone (figure 18).
    """
    device = next(model.parameters()).device
    clips = dataset.expert_clip(source, target), dataset.frames[target]
    expert, true = (to_input(clip).to(device) for clip in clips)
    z2, skips = model.encode_context(true[:1])
    z_true = model.encode_expert(true)
    z1 = model.encode_expert(expert)
    z3 = model.translate(z1, z2, embed_task(model, z1))
    skip_terms = model.decoder.skip_terms(skips)
    translated = model.decoder(z3, skip_terms)
    losses = [
        float(frame_loss(translated, true)),
        float(frame_loss(model.decoder(z_true, skip_terms), true)),
        float(alignment_loss(z3, z_true)),
    ]
    shown, wanted = to_frames(translated), np.array(dataset.frames[target])
    names, sources = dataset.clips["clip"], (dataset.experts or dataset).clips["clip"]
    row: dict[str, str | float] = {
        "clip": names.iloc[target],
        "source": sources.iloc[source],
        "pair": dataset.clips["pair"].iloc[target],
        "split": dataset.clips["split"].iloc[target],
        "loss": sum(losses),
        **dict(zip(NAMES, losses, strict=True)),
        "last_frame": float(frame_loss(translated[-1:], true[-1:])),
        "psnr": psnr(shown, wanted),
        "ssim": ssim(shown, wanted),
        **yardsticks(shown, wanted),
    }
    return ClipEvaluation(row, np.concatenate((wanted, shown), axis=2))


def evaluate(
    model: Translator,
    dataset: Dataset,
    folder: Path,
    params: Assessment,
    rng: np.random.Generator,
) -> None:
    """Fill ``folder`` with what the translator makes of its held-out clips.

    - ``clips.csv``: a row for each of the first ``params.clips`` validation clips and for each extreme clip,
      where ``placed`` and its like are empty for a clip without a blue object;
    - ``clips/<clip>.avi``: of each split the first ``params.shown``, true frames beside the translated ones;
    - ``strips/<clip>.png``: every 7th frame of these, true over translated;
    - ``feature_weights.csv``: the weight of every frame of the expert's clip.
    """
    use_threads(1)
    model = model.to(torch_device())
    validation = clip_pairs(dataset, "validation")[: params.clips]
    chosen = {"validation": validation, "extreme": clip_pairs(dataset, "extreme")}
    rows = []
    for name in ("clips", "strips"):
        (folder / name).mkdir()
    with track("translate", sum(map(len, chosen.values()))) as tracker:
        for pairs in chosen.values():
            for index, evaluated in enumerate(_evaluate_clips(model, dataset, pairs)):
                rows.append(evaluated.row)
                if index < params.shown:
                    name = dataset.clips["clip"].iloc[pairs[index][1]]
                    write_video(folder / "clips" / f"{name}.avi", evaluated.frames, _RATE)
                    write_png(folder / "strips" / f"{name}.png", strip(evaluated.frames))
                tracker.advance()
    _write(folder / "clips.csv", pd.DataFrame(rows))
    _write(
        folder / "feature_weights.csv", feature_weights(model, dataset, validation, params.permutations, rng)
    )


def strip(frames: np.ndarray) -> np.ndarray:
    """Every 7th frame and the last of side-by-side ``frames`` (T, H, 2 W, 3), true over translated."""
    kept = frames[sorted({*range(0, len(frames), _STRIP_STEP), len(frames) - 1})]
    true, translated = np.split(kept, 2, axis=2)
    return np.concatenate([np.concatenate(list(row), axis=1) for row in (true, translated)])


def _evaluate_clips(
    model: Translator, dataset: Dataset, pairs: list[tuple[int, int]]
) -> Iterator[ClipEvaluation]:
    with ThreadPoolExecutor(worker_count()) as pool:
        yield from pool.map(lambda pair: evaluate_clip(model, dataset, *pair), pairs)


def _write(path: Path, table: pd.DataFrame) -> None:
    table.to_csv(path, index=False, float_format="%.6g")
