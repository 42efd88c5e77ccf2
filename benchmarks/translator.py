"""Training of the context translator against a plain PyTorch loop, side by side in one run.

    python benchmarks/translator.py [compact real ...] [--rounds 5]      speed and share of the peak
    python benchmarks/translator.py --curves 120 [compact]               loss curves of both, three seeds
    python benchmarks/translator.py --data data/clips/diverse            decoding and memory of a set of clips

The plain loop is eager float32: every encoder is called separately, skips are concatenated, the optimiser is
PyTorch's default and every operation runs on all cores. Both have the same frames in memory, the same weights
to start from and the same batches. Rounds alternate and the fastest of each counts: what else the machine
does can only slow a round down. Run it on an idle machine. The peak is that of a large matrix product in
bfloat16 on all cores.
"""

import argparse
import os
import tempfile
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pandas as pd
import torch
from torch import Tensor
from torch.nn import functional as F
from torch.utils.flop_counter import FlopCounterMode

from anyview.config import LossWeights, Pretraining, Training, TranslatorCell
from anyview.runtime.device import dtype_of_products, worker_count
from anyview.seeds import torch_seed
from anyview.training.common.fit import update, validate
from anyview.training.common.optimization import SharedOptimizer
from anyview.training.translator import TranslatorObjective
from anyview.translator.losses import batch_losses
from anyview.translator.network import ARCHITECTURES, ContextTranslator
from anyview.video.datasets import Dataset
from anyview.video.pixels import to_input
from anyview.video.sets import open_frames

BATCH, CLIPS, LENGTH = 100, 120, 20
THREADS = 2  # of our loop, as in training
ONE = LossWeights(translation=1.0, reconstruction=1.0, alignment=1.0)


def make_dataset(size: int) -> Dataset:
    """Clips of smooth, slowly moving blobs: contents do not change the speed, but losses can fall."""
    rng = np.random.default_rng(0)
    axis = np.linspace(-1, 1, size)
    frames = np.empty((CLIPS, LENGTH, size, size, 3), np.uint8)
    for clip in frames:
        start, end = rng.uniform(-0.7, 0.7, (2, 2))
        ground, colour = rng.uniform(60, 200, (2, 3))
        for t, frame in enumerate(clip):
            y, x = start + (end - start) * t / (LENGTH - 1)
            blob = np.exp(-((axis[:, None] - y) ** 2 + (axis - x) ** 2) / 0.05)[..., None]
            frame[:] = ground + (colour - ground) * blob
    table = pd.DataFrame({"clip": [str(n) for n in range(CLIPS)], "pair": "", "split": "train"})
    table.loc[100:, "split"] = "validation"
    return Dataset("benchmark", frames, table)


def make_objective(architecture: str, dataset: Dataset, seed: int = 0) -> TranslatorObjective:
    cell = TranslatorCell(
        dataset="diverse",
        architecture=architecture,
        optimizer="adam",
        iterations=1000,
        weights=ONE,
        pretraining=Pretraining(dataset="diverse", iterations=0),
        augment=False,
    )
    training = Training(
        batch_size=BATCH,
        learning_rate=0.001,
        schedule="constant",
        precision="bfloat16",
        validation_every=40,
        validation_pairs=2 * BATCH,
    )
    return TranslatorObjective(cell, training, seed, dataset)


class PlainLoop:
    """The loop that the equations suggest."""

    def __init__(self, objective: TranslatorObjective):
        torch.manual_seed(torch_seed(objective.seed, "translator/weights"))
        self.model = ContextTranslator(objective.cell.architecture, objective.dataset.image_size)
        self._optimizer = torch.optim.Adam(self.model.parameters(), lr=objective.training.learning_rate)
        self._objective = objective
        self._noise = torch.Generator()

    def step(self, iteration: int) -> float:
        """One update; returns the loss."""
        loss = self.loss(iteration)
        self._optimizer.zero_grad()
        loss.backward()
        self._optimizer.step()
        return loss.item()

    def loss(self, iteration: int) -> Tensor:
        """L of the iteration's batch."""
        pairs, dataset = self._objective.batch(iteration), self._objective.dataset
        expert, target = to_input(pairs.frames(dataset)).contiguous().chunk(2)
        context = to_input(pairs.contexts(dataset)).contiguous()
        model, noise = self.model, self._noise
        z1 = model.encode_expert(expert, noise)
        z2, skips = model.encode_context(context, noise)
        z_true = model.encode_expert(target, noise)
        z3 = model.translate(z1, z2, noise=noise)
        translated, reconstructed = (self._decode(z, skips) for z in (z3, z_true))
        loss = 0.5 * ((translated - target) ** 2).sum() + 0.5 * ((reconstructed - target) ** 2).sum()
        return loss + 1000 * ((z3 - z_true) ** 2).mean()

    def _decode(self, z: Tensor, skips: list[Tensor]) -> Tensor:
        decoder = self.model.decoder
        x = F.leaky_relu(decoder.hidden(z), 0.2)
        x = F.dropout(x, ARCHITECTURES[self.model.architecture].dropout)
        channels, side = skips[-1].shape[1:3]
        x = x.view(len(x), side, side, channels).permute(0, 3, 1, 2)
        for index, (layer, skip) in enumerate(zip(decoder.convolutions, skips[::-1], strict=True)):
            x = torch.cat((x, skip), dim=1)
            stride = layer.stride[0]
            x = F.conv_transpose2d(x, layer.weight, layer.bias, stride, padding=2, output_padding=stride - 1)
            x = F.leaky_relu(x, 0.2) if index < 3 else x
        return x


class FastLoop:
    """Ours."""

    def __init__(self, objective: TranslatorObjective):
        torch.set_num_threads(1)
        self._objective, self._model = objective, objective.network()
        dtype = dtype_of_products(objective.training.precision, torch.device("cpu"))
        self._optimizer = SharedOptimizer(self._model, objective.optimizer, THREADS, dtype)
        self._validation, self._pool = objective.validation(), ThreadPoolExecutor(THREADS)

    def step(self, iteration: int) -> float:
        """One update; returns the loss."""
        return update(self._objective, self._optimizer, iteration, self._pool)[0].item()

    def validate(self) -> None:
        """Forward passes of 2 batches."""
        validate(self._objective, self._model, self._validation, self._pool)


def seconds(work: Callable[[], object]) -> float:
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def peak(dtype: torch.dtype, size: int = 2048) -> float:
    """Floating-point operations per second of a square matrix product, the best of several."""
    torch.set_num_threads(os.cpu_count() or 1)
    a = torch.randn(size, size, dtype=dtype)
    return 2 * size**3 / min(seconds(lambda: a @ a) for _ in range(8))


def operations(objective: TranslatorObjective) -> tuple[int, int]:
    """Floating-point operations of the fast loop's network, forward and backward, for one batch."""
    model, pairs, dataset = objective.network(), objective.batch(0), objective.dataset
    paired, context = to_input(pairs.frames(dataset)), to_input(pairs.contexts(dataset))
    with FlopCounterMode(display=False) as forward:
        loss = batch_losses(model, paired, context).total(ONE)
    with FlopCounterMode(display=False) as backward:
        loss.backward()
    return forward.get_total_flops(), backward.get_total_flops()


def compare_speed(architecture: str, rounds: int) -> None:
    """Print samples per second of both loops, and the fast loop's share of the peak."""
    dataset = make_dataset(48 if architecture == "real" else 64)
    objective = make_objective(architecture, dataset)
    fast, plain = FastLoop(objective), PlainLoop(objective)
    times: dict[str, list[float]] = {"fast": [], "plain": [], "forward": []}
    for number in range(rounds + 1):
        torch.set_num_threads(os.cpu_count() or 1)
        times["plain"] += [seconds(lambda n=number: plain.step(n)) for _ in range(3)]
        torch.set_num_threads(1)
        times["fast"] += [seconds(lambda n=number: fast.step(n)) for _ in range(3)]
        times["forward"] += [seconds(lambda: fast.validate()) / 2 for _ in range(3)]
    best = {name: min(found[3:]) for name, found in times.items()}
    forward, backward = operations(objective)
    top = peak(torch.bfloat16)
    shares = forward / best["forward"] / top, backward / (best["fast"] - best["forward"]) / top
    print(
        f"{architecture:8} {BATCH / best['plain']:9.0f} {BATCH / best['fast']:9.0f} "
        f"{best['plain'] / best['fast']:7.2f} {shares[0]:8.0%} {shares[1]:8.0%}   "
        f"{(forward + backward) / 1e9:6.1f} {top / 1e9:9.0f}",
        flush=True,
    )


def compare_curves(architecture: str, iterations: int, seeds: int = 3) -> None:
    """Print the mean loss of the last tenth of a short training, of both loops and several seeds."""
    dataset = make_dataset(48 if architecture == "real" else 64)
    tail = max(1, iterations // 10)
    ends: dict[str, list[float]] = {"plain": [], "fast": []}
    for seed in range(seeds):
        objective = make_objective(architecture, dataset, seed)
        torch.set_num_threads(os.cpu_count() or 1)
        plain = PlainLoop(objective)
        ends["plain"].append(float(np.mean([plain.step(n) for n in range(iterations)][-tail:])))
        fast = FastLoop(objective)
        ends["fast"].append(float(np.mean([fast.step(n) for n in range(iterations)][-tail:])))
    for name, found in ends.items():
        losses = " ".join(f"{loss:8.0f}" for loss in found)
        spread = np.std(found, ddof=1)
        print(f"{architecture:8} {name:5} {losses}   mean {np.mean(found):8.0f}  spread {spread:6.0f}")


def measure_data(folder: Path) -> None:
    """Print how long decoding and mapping take, and the peak of memory that is not mapped frames."""
    with tempfile.TemporaryDirectory(dir=os.environ.get("ANYVIEW_SCRATCH")) as scratch:
        os.environ["ANYVIEW_SCRATCH"] = scratch
        before = resident()
        highest = [before]
        stop = threading.Event()

        def watch() -> None:
            while not stop.wait(0.02):
                highest[0] = max(highest[0], resident())

        watcher = threading.Thread(target=watch)
        watcher.start()
        decoding = seconds(lambda: open_frames(folder))
        mapping = seconds(lambda: open_frames(folder))
        frames = open_frames(folder).frames
        rng = np.random.default_rng(0)
        gathering = seconds(
            lambda: [
                frames[rng.integers(len(frames), size=300), rng.integers(frames.shape[1], size=300)]
                for _ in range(50)
            ]
        )
        stop.set()
        watcher.join()
    print(f"{folder}: {len(frames)} clips, {frames.nbytes / 1e9:.2f} GB of frames, {worker_count()} workers")
    print(f"decoding, once per machine    {decoding:8.1f} s")
    print(f"opening the map, once a cell  {mapping:8.1f} s (checksums of the video files)")
    print(f"gathering a batch of 100      {gathering / 50 * 1e3:8.1f} ms")
    print(f"memory beyond the mapped frames, at most {(highest[0] - before) / 1e6:.0f} MB")


def resident() -> int:
    """Bytes of this process's memory that no file backs."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("RssAnon"):
            return int(line.split()[1]) * 1024
    raise RuntimeError("/proc/self/status states no RssAnon")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("architectures", nargs="*", default=["compact", "real"], help="compact, real or sim")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--curves", type=int, metavar="ITERATIONS", help="compare loss curves instead")
    parser.add_argument("--data", type=Path, metavar="FOLDER", help="measure a set of clips instead")
    options = parser.parse_args()
    if options.data:
        measure_data(options.data)
    elif options.curves:
        print("loss, mean of the last tenth, by seed")
        for architecture in options.architectures:
            compare_curves(architecture, options.curves)
    else:
        print("             samples a second           share of peak   Gflop  peak, Gflop/s")
        print("             plain      fast   ratio  forward backward   a batch")
        for architecture in options.architectures:
            compare_speed(architecture, options.rounds)


if __name__ == "__main__":
    main()
