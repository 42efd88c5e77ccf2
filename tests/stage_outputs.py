"""Small folders in the stages' own formats, for analysis and report to read: invented numbers, real files."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from anyview.analysis.study import EvaluatedMethod
from anyview.config import Params, load_params
from anyview.video.files import write_video
from anyview.video.sets import write_set, write_shard

ROOT = Path(__file__).parents[1]
RUNS = 15
SIZE = 32


def clip(frames: int, shift: float, hue: int) -> np.ndarray:
    """A disc that crosses the picture, uint8 RGB (frames, SIZE, SIZE, 3)."""
    y, x = np.mgrid[:SIZE, :SIZE]
    pictures = np.full((frames, SIZE, SIZE, 3), 150, np.uint8)
    for step in range(frames):
        centre = 5 + shift + (SIZE - 12) * step / frames
        pictures[step][np.hypot(y - SIZE / 2, x - centre) < 4] = np.roll([30, 60, 200], hue)
    return pictures


def evaluated(distance, curve: pd.DataFrame | None = None, runs=range(RUNS), **returns) -> EvaluatedMethod:
    """A method as its tables tell it: final distances (RUNS,), or one for all, over ``runs``."""
    distance = np.broadcast_to(distance, RUNS)
    table = pd.DataFrame(
        {"run": range(RUNS), "success": distance < 0.02, "final_distance": distance, **returns}
    )
    if curve is None:
        curve = pd.DataFrame({"iteration": [0], "run": [0], "final_distance": [0.5], "return": [-1.0]})
    return EvaluatedMethod(Path(), table[table["run"].isin(runs)], curve, ())


class Data:
    """Writes results below ``root`` as the stages would."""

    def __init__(self, root: Path):
        self.root = root
        self.rng = np.random.default_rng(1)

    def demonstrations(self, kind: str, count: int = 40) -> None:
        folder = self._folder("clips", kind)
        clips = [f"{kind}-{index:04d}" for index in range(count)]
        shards = np.arange(count) // 20
        rows = {"clip": clips, "shard": shards, "position": np.arange(count) % 20}
        stored = [
            write_shard(folder, shard, np.stack([clip(50, n, 2) for n in range(20)])) for shard in set(shards)
        ]
        rows["success"] = [index != 3 for index in range(count)]
        write_set(folder, pd.DataFrame(rows), stored)
        self._json(folder / "summary.json", demos=count, expert_success=0.975, acceptance=0.4)

    def real_clips(self) -> None:
        folder = self._folder("clips", "real")
        clips = [f"clip-{index:03d}" for index in range(12)]
        pairs, cameras = [f"pair-{index // 2}" for index in range(12)], ["left", "right"] * 6
        files = [f"{clip}.avi" for clip in clips]
        self._csv(folder / "manifest.csv", clip=clips, file=files, pair=pairs, camera=cameras)
        azimuths = [120.0, 5.0] * 6  # 115 degrees between the cameras
        raw = self._folder("raw", "surrogate") / "manifest.csv"
        self._csv(raw, file=files, pair=pairs, camera=cameras, azimuth=azimuths)
        self._csv(folder / "refused.csv", file=["dark.avi"], pair=["dark"], reason=["too dark"])
        places = ["train"] * 6 + ["validation"] * 4 + ["extreme"] * 2
        self._csv(self._folder("splits") / "real.csv", clip=clips, pair=pairs, split=places)

    def translator(self, cell: str, iterations: int = 520, extreme: bool = False, scale: float = 1.0) -> None:
        folder = self._folder("models", cell)
        steps = np.arange(40, iterations + 1, 40)
        loss = scale * (40_000 * np.exp(-steps / 90) + 4_000)
        self._csv(folder / "curve.csv", iteration=steps, loss=loss, validation_loss=1.05 * loss)
        self._json(folder / "model.json", best_iteration=480, architecture="compact", image_size=SIZE)
        folder = self._folder("translations", cell)
        places = ["validation"] * 6 + ["extreme"] * (4 if extreme else 0)
        clips = [f"clip-{index:03d}" for index in range(len(places))]
        hard = np.where(np.array(places) == "extreme", 2.7, 1.0) * scale
        pairs = [f"pair-{index // 2}" for index in range(len(places))]
        sources = [clips[index ^ 1] for index in range(len(clips))]
        rows = pd.DataFrame({"clip": clips, "source": sources, "pair": pairs, "split": places})
        for name, size in (
            ("loss", 4_000),
            ("translation", 2_000),
            ("reconstruction", 1_900),
            ("alignment", 100),
        ):
            rows[name] = hard * size * self.rng.uniform(0.8, 1.2, len(places))
        rows["last_frame"] = rows["translation"]
        rows["psnr"], rows["ssim"] = (
            self.rng.uniform(20, 25, len(places)),
            self.rng.uniform(0.7, 0.9, len(places)),
        )
        rows["copy_loss"], rows["mean_loss"] = 1.5 * rows["translation"], 0.9 * rows["translation"]
        for name in ("placed", "placed_on_way", "copy_placed"):
            # In these clips nothing is blue, as it may be in clips of one's own.
            rows[name] = None if cell == "real-adadelta" else self.rng.uniform(0.3, 0.9, len(places))
        rows.to_csv(folder / "clips.csv", index=False)
        frames = 80 if cell.startswith("real") else 50
        self._csv(folder / "feature_weights.csv", frame=range(frames), weight=[1 / frames] * frames)
        (folder / "clips").mkdir()
        for index, name in enumerate(clips[:3] + clips[6:9]):
            pair = np.concatenate([clip(frames, 0, 0), clip(frames, 1, index % 3)], axis=2)
            write_video(folder / "clips" / f"{name}.avi", pair, 10.0)

    def policies(
        self, cell: str, distance: float, returns: bool = True, blind: bool = False, last: int = 240
    ) -> None:
        folder = self._folder("policies", cell)
        context = np.linspace(-0.03, 0.03, RUNS)
        distances = np.clip(distance + context + self.rng.normal(0, 0.008, RUNS), 0.003, None)
        runs = {"run": range(RUNS), "success": distances < 0.02, "final_distance": distances}
        runs["return_policy"] = -12 - 100 * distances
        if returns:
            runs |= {
                "return_still": self.rng.normal(-65, 1, RUNS),
                "return_arm_only": self.rng.normal(-33, 1, RUNS),
                "return_expert": self.rng.normal(-12, 0.5, RUNS),
            }
        self._csv(folder / "runs.csv", **runs)
        rows = []
        for run in range(RUNS):
            for iteration in range(0, last + 10, 10):
                left = distances[run] + 0.5 * np.exp(-iteration / 60) + self.rng.normal(0, 0.01)
                gained = self.rng.normal() if blind else -100 * left
                rows.append({"iteration": iteration, "run": run, "final_distance": left, "return": gained})
        curve = pd.DataFrame(rows)
        if blind:
            curve["expert_accuracy"], curve["agent_accuracy"] = 0.97, 0.93
        curve.to_csv(folder / "curve.csv", index=False)
        self._csv(folder / "demonstrations.csv", clip=["diverse-0003", "diverse-0007"])
        (folder / "rollouts").mkdir()
        for run in range(RUNS):
            pair = np.concatenate([clip(50, run, 0), clip(50, run, 1)], axis=2)
            write_video(folder / "rollouts" / f"run-{run:02d}.avi", pair, 10.0)

    def _folder(self, *parts: str) -> Path:
        folder = self.root.joinpath("data", *parts)
        folder.mkdir(parents=True, exist_ok=True)
        return folder

    @staticmethod
    def _csv(path: Path, **columns) -> None:
        pd.DataFrame(columns).to_csv(path, index=False)

    @staticmethod
    def _json(path: Path, **values) -> None:
        path.write_text(json.dumps(values))


@pytest.fixture(scope="session")
def params() -> Params:
    """The repository's own params."""
    return load_params(ROOT / "params.yaml")


@pytest.fixture
def data(tmp_path) -> Data:
    """Nothing yet."""
    return Data(tmp_path)


def whole_study(root: Path) -> None:
    """Every cell."""
    data = Data(root)
    for kind in ("diverse", "narrow"):
        data.demonstrations(kind)
    data.real_clips()
    cells = load_params(ROOT / "params.yaml")
    for cell in cells.translators:
        data.translator(cell, extreme=cell.startswith("real"))
    distances = {"ours": 0.03, "oracle": 0.015, "tpil": 0.5, "gail": 0.45}
    for index, cell in enumerate(cells.methods):
        learned = cell in ("tpil", "gail")
        data.policies(cell, distances.get(cell, 0.03 + 0.01 * index), returns=not learned, blind=learned)


def run_report(root: Path, *arguments: str) -> subprocess.CompletedProcess:
    """Run the report stage in ``root`` as DVC would, with the repository's own params and pipeline."""
    (root / "stages").mkdir(exist_ok=True)
    shutil.copy(ROOT / "params.yaml", root)
    shutil.copy(ROOT.joinpath(*arguments, "dvc.yaml"), root)
    command = [sys.executable, ROOT / "stages/report.py", *arguments]
    return subprocess.run(command, cwd=root, capture_output=True, text=True)


@pytest.fixture(scope="session")
def report():
    """``report(root)`` runs the stage in ``root``, ``report(root, "beyond")`` that of beyond/."""
    return run_report


@pytest.fixture(scope="session")
def full(tmp_path_factory) -> Path:
    """A root with results of every cell below ``data``."""
    root = tmp_path_factory.mktemp("study")
    whole_study(root)
    return root
