"""What the stages before left behind, read once: tables as data frames, checked when they are read."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from anyview.config import Params
from anyview.paths import REAL
from anyview.runtime.errors import AnyviewError
from anyview.video.files import read_video
from anyview.video.manifests import read_table
from anyview.video.splits import read_split

LOSSES = ("loss", "translation", "reconstruction", "alignment", "psnr", "ssim")
RETURNS = ("return_policy", "return_still", "return_arm_only", "return_expert")


@dataclass(frozen=True)
class Demonstrations:
    """A simulated set: a row per demonstration, and the share of proposed contexts that were accepted."""

    folder: Path
    manifest: pd.DataFrame
    acceptance: float

    @property
    def success(self) -> np.ndarray:
        """Whether the expert succeeded (n,)."""
        return self.manifest["success"].to_numpy(bool)

    def frames(self, clip: str) -> np.ndarray:
        """A demonstration's frames, uint8 RGB (T, H, W, 3): its shard alone is read."""
        row = self.manifest.set_index("clip").loc[clip]
        stored = read_table(self.folder / "files.csv", ["file", "frames"]).iloc[int(row["shard"])]
        shard = read_video(self.folder / stored["file"])
        start = int(row["position"]) * int(stored["frames"])
        return shard[start : start + int(stored["frames"])]


@dataclass(frozen=True)
class Clips:
    """How many real clips came through ingest, and how many were refused."""

    recorded: int
    refused: int


@dataclass(frozen=True)
class Training:
    """A trained translator: ``curve`` has a row per validation."""

    curve: pd.DataFrame
    best_iteration: int

    def losses(self, column: str) -> pd.Series:
        """A column of the curve by iteration."""
        return self.curve.set_index("iteration")[column]


@dataclass(frozen=True)
class Translation:
    """A translator's evaluation: a row per clip (``clip, split`` and LOSSES), a weight per frame (T,)."""

    folder: Path
    clips: pd.DataFrame
    feature_weights: np.ndarray

    def split(self, name: str) -> pd.DataFrame:
        """The rows of one split."""
        return self.clips[self.clips["split"] == name]

    def filmed(self, split: str) -> list[str]:
        """Clips of a split that were written out as video, in their order."""
        return [clip for clip in self.split(split)["clip"] if self._video(clip).exists()]

    def frames(self, clip: str) -> np.ndarray:
        """The clip's true frames with the translated ones to their right, uint8 RGB (T, H, 2 W, 3)."""
        return read_video(self._video(clip))

    def _video(self, clip: str) -> Path:
        return self.folder / "clips" / f"{clip}.avi"


@dataclass(frozen=True)
class Evaluation:
    """A method's evaluation: a row per run; a row per iteration and run; the clips that rewards average."""

    folder: Path
    runs: pd.DataFrame
    curve: pd.DataFrame
    demonstrations: tuple[str, ...]

    @property
    def rollouts(self) -> list[int]:
        """Runs whose rollout was filmed."""
        return [int(run) for run in self.runs["run"] if self._video(int(run)).exists()]

    def rollout(self, run: int) -> np.ndarray:
        """The policy's frames with the imitated demonstration to their right, uint8 RGB (T, H, 2 W, 3)."""
        return read_video(self._video(run))

    def _video(self, run: int) -> Path:
        return self.folder / "rollouts" / f"run-{run:02d}.avi"

    @property
    def has_return_table(self) -> bool:
        """Whether the reward can score the expert's own motion (learned discriminators cannot)."""
        return set(RETURNS) <= set(self.runs.columns) and bool(
            self.runs[list(RETURNS)].notna().all(axis=None)
        )


@dataclass(frozen=True)
class Study:
    """Everything a report is made from. Only what exists: a cell that was not run has no entry."""

    params: Params
    demonstrations: dict[str, Demonstrations]
    clips: Clips | None
    splits: dict[str, pd.DataFrame]
    trainings: dict[str, Training]
    translations: dict[str, Translation]
    evaluations: dict[str, Evaluation]
    sources: tuple[Path, ...]

    @property
    def surrogate(self) -> bool:
        """Whether the "real" clips are rendered stand-ins."""
        return self.params.real.source == "surrogate"

    def is_real(self, cell: str) -> bool:
        """Whether a translator cell was trained on the real clips, or on their surrogate."""
        return self.params.translators[cell].dataset == REAL


def read_study(data: Path, params: Params) -> Study:
    """Read the results below ``data``; AnyviewError names a broken file, or says that there is nothing."""
    sets = _present(data / "clips", params.simulate.sets)
    clips = _present(data / "clips", [REAL])
    splits = _present(data / "splits", params.split, ".csv")
    models = _present(data / "models", params.translators)
    translations = _present(data / "translations", params.translators)
    policies = _present(data / "policies", params.methods)
    found = (sets, clips, splits, models, translations, policies)
    if not any(found):
        raise AnyviewError(f"{data}: nothing to report on yet; run `dvc repro`")
    return Study(
        params,
        {kind: _demonstrations(folder) for kind, folder in sets.items()},
        _clips(clips[REAL]) if clips else None,
        {name: read_split(path) for name, path in splits.items()},
        {cell: _training(folder) for cell, folder in models.items()},
        {cell: _translation(folder) for cell, folder in translations.items()},
        {cell: _evaluation(folder) for cell, folder in policies.items()},
        tuple(path for group in found for path in group.values()),
    )


def _present(folder: Path, names: Iterable[str], suffix: str = "") -> dict[str, Path]:
    paths = {name: folder / f"{name}{suffix}" for name in names}
    return {name: path for name, path in paths.items() if path.exists()}


def _demonstrations(folder: Path) -> Demonstrations:
    manifest = read_table(folder / "manifest.csv", ["clip", "shard", "position", "success"], unique="clip")
    return Demonstrations(folder, manifest, float(_json(folder / "summary.json", "acceptance")["acceptance"]))


def _clips(folder: Path) -> Clips:
    recorded, refused = (read_table(folder / f"{name}.csv", ["file"]) for name in ("manifest", "refused"))
    return Clips(len(recorded), len(refused))


def _training(folder: Path) -> Training:
    curve = _numbers(folder / "curve.csv", ["iteration", "loss", "validation_loss"])
    return Training(curve, int(_json(folder / "model.json", "best_iteration")["best_iteration"]))


def _translation(folder: Path) -> Translation:
    clips = read_table(folder / "clips.csv", ["clip", "split", *LOSSES], unique="clip")
    weights = _numbers(folder / "feature_weights.csv", ["frame", "weight"])
    return Translation(folder, clips, weights["weight"].to_numpy())


def _evaluation(folder: Path) -> Evaluation:
    runs = _numbers(folder / "runs.csv", ["run", "success", "final_distance"])
    curve = _numbers(folder / "curve.csv", ["iteration", "run", "final_distance", "return"])
    demonstrations = read_table(folder / "demonstrations.csv", ["clip"])["clip"]
    return Evaluation(folder, runs.sort_values("run", ignore_index=True), curve, tuple(demonstrations))


def _numbers(path: Path, columns: list[str]) -> pd.DataFrame:
    """A table whose columns are numbers; empty cells are NaN, but not in the columns that must be there."""
    table = read_table(path, columns)
    for column in table.columns:
        text = table[column]
        table[column] = pd.to_numeric(text.replace({"True": 1, "False": 0, "": None}), errors="coerce")
        if (table[column].isna() & (text != "")).any() or (column in columns and table[column].isna().any()):
            raise AnyviewError(f"{path}: column {column} holds something that is no number")
    if table.empty:
        raise AnyviewError(f"{path}: it has no rows")
    return table


def _json(path: Path, key: str) -> dict:
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise AnyviewError(f"{path}: no such file") from None
    except ValueError as error:
        raise AnyviewError(f"{path}: not valid JSON: {error}") from None
    if not isinstance(values, dict) or not isinstance(values.get(key), int | float):
        raise AnyviewError(f"{path}: {key}: missing or no number")
    return values
