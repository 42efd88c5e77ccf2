"""Outputs of the stages, read once and checked when they are read: tables as data frames, clips on demand."""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from anyview import paths
from anyview.config import Params
from anyview.runtime.errors import AnyviewError
from anyview.video.files import read_video
from anyview.video.manifests import read_table
from anyview.video.sets import read_stored
from anyview.video.splits import read_split

LOSSES = ("loss", "translation", "reconstruction", "alignment", "psnr", "ssim")
YARDSTICKS = ("copy_loss", "mean_loss", "placed", "placed_on_way", "copy_placed")
"""See ``assessment.yardsticks``; empty for a clip to which one does not apply."""
SURROGATE = "surrogate"
RETURNS = ("return_policy", "return_still", "return_arm_only", "return_expert")


@dataclass(frozen=True)
class SimulatedSet:
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
        return read_stored(self.folder, clip)[0]


@dataclass(frozen=True)
class RealClips:
    """How many real clips came through ingest, and how many were refused."""

    recorded: int
    refused: int


@dataclass(frozen=True)
class TrainedModel:
    """A trained translator. ``curve`` has a row per validation: ``iteration, loss, validation_loss``."""

    curve: pd.DataFrame
    best_iteration: int


@dataclass(frozen=True)
class AssessedTranslator:
    """A translator on held-out clips: a row per clip, a weight per frame (T,).

    Columns: ``clip, source, split``, LOSSES, YARDSTICKS.
    """

    folder: Path
    clips: pd.DataFrame
    feature_weights: np.ndarray

    def split(self, name: str) -> pd.DataFrame:
        """The rows of one split."""
        return self.clips[self.clips["split"] == name]

    def filmed(self, split: str) -> list[str]:
        """Clips of a split that were written out as video, in their order."""
        return [clip for clip in self.split(split)["clip"] if self._video(clip).exists()]

    def typical(self, split: str) -> str:
        """The clip of median loss among those of ``split`` that were written out as video."""
        clips = self.split(split)
        filmed = clips[clips["clip"].isin(self.filmed(split))].sort_values("loss", kind="stable")
        return str(filmed["clip"].iloc[(len(filmed) - 1) // 2])

    def frames(self, clip: str) -> np.ndarray:
        """The clip's true frames with the translated ones to their right, uint8 RGB (T, H, 2 W, 3)."""
        return read_video(self._video(clip))

    def _video(self, clip: str) -> Path:
        return self.folder / "clips" / f"{clip}.avi"


@dataclass(frozen=True)
class EvaluatedMethod:
    """A method: a row per run, a row per iteration and run, and the clips that it imitates.

    Where the clips choose between two goals, runs have ``context``, ``choice`` and ``other_distance``.
    """

    folder: Path
    runs: pd.DataFrame
    curve: pd.DataFrame
    demonstrations: tuple[str, ...]

    @property
    def rollouts(self) -> list[int]:
        """Runs whose rollout was filmed."""
        return [int(run) for run in self.runs["run"] if self._video(int(run)).exists()]

    @property
    def median_run(self) -> int:
        """The run of median final distance."""
        return int(self.runs.sort_values("final_distance", kind="stable")["run"].iloc[len(self.runs) // 2])

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
class Rankings:
    """Scripted rollouts under the reward of each method; runs of one ``context`` are of both choices.

    ``rollouts``: ``cell, context, run, kind, rollout, final_distance, return``. ``values``, of the frames of
    a good one: ``cell, context, run, step, value``.
    """

    rollouts: pd.DataFrame
    values: pd.DataFrame


@dataclass(frozen=True)
class Study:
    """Everything a report is made from. Only what exists: a cell that was not run has no entry."""

    params: Params
    simulated: dict[str, SimulatedSet]
    real: RealClips | None
    splits: dict[str, pd.DataFrame]
    models: dict[str, TrainedModel]
    translators: dict[str, AssessedTranslator]
    methods: dict[str, EvaluatedMethod]
    azimuths: pd.Series
    """Where the camera of each filmed clip stood, degrees by clip; empty where nothing tells."""
    rankings: Rankings | None
    sources: tuple[Path, ...]

    @property
    def surrogate(self) -> bool:
        """Whether the "real" clips are rendered stand-ins."""
        return self.params.real.source == SURROGATE

    def is_real(self, cell: str) -> bool:
        """Whether a translator cell was trained on the real clips, or on their surrogate."""
        return self.params.translators[cell].dataset == paths.REAL


def read_study(params: Params, root: Path = Path()) -> Study:
    """Read the results below ``root``; AnyviewError names a broken file, or says that there is nothing."""

    def present(place: Callable[[str], Path], names: Iterable[str]) -> dict[str, Path]:
        found = {name: root / place(name) for name in names}
        return {name: path for name, path in found.items() if path.exists()}

    simulated = present(paths.clip_set, params.simulate.sets)
    real = present(paths.clip_set, [paths.REAL] if paths.REAL in params.split else [])
    splits = present(paths.split_table, params.split)
    models = present(paths.model, params.translators)
    translations = present(paths.translations, params.translators)
    policies = present(paths.policies, params.methods)
    filmed = present(paths.raw, [SURROGATE] if real and params.real.source == SURROGATE else [])
    rankings = present(lambda _: paths.RANKINGS, [paths.RANKINGS.name])
    groups = (simulated, real, splits, models, translations, policies, filmed, rankings)
    if not any(groups):
        raise AnyviewError(f"{root / paths.DATA}: nothing to report on yet; run `dvc repro`")
    return Study(
        params,
        {name: _simulated(folder) for name, folder in simulated.items()},
        _real(real[paths.REAL]) if real else None,
        {name: read_split(path) for name, path in splits.items()},
        {cell: _model(folder) for cell, folder in models.items()},
        {cell: _translator(folder) for cell, folder in translations.items()},
        {cell: read_method(folder) for cell, folder in policies.items()},
        read_azimuths(real[paths.REAL], filmed[SURROGATE]) if filmed else pd.Series(dtype=float),
        _rankings(root / paths.RANKINGS) if rankings else None,
        tuple(path for group in groups for path in group.values()),
    )


def _simulated(folder: Path) -> SimulatedSet:
    manifest = read_table(folder / "manifest.csv", ["clip", "success"], unique="clip")
    return SimulatedSet(folder, manifest, float(_json(folder / "summary.json", "acceptance")["acceptance"]))


def _real(folder: Path) -> RealClips:
    recorded, refused = (read_table(folder / f"{name}.csv", ["file"]) for name in ("manifest", "refused"))
    return RealClips(len(recorded), len(refused))


def read_azimuths(clips: Path, raw: Path) -> pd.Series:
    """Where the cameras stood of those ``clips`` whose ``raw`` ones tell it, in degrees by clip."""
    named = read_table(clips / "manifest.csv", ["clip", "pair", "camera"], unique="clip")
    told = read_table(raw / "manifest.csv", ["pair", "camera"])
    if "azimuth" not in told:
        return pd.Series(dtype=float)
    merged = named.merge(told[["pair", "camera", "azimuth"]], on=["pair", "camera"])
    return pd.to_numeric(merged.set_index("clip")["azimuth"])


def _rankings(folder: Path) -> Rankings:
    keys, text = ["context", "run"], ("cell", "kind")
    return Rankings(
        _numbers(folder / "rollouts.csv", ["cell", *keys, "kind", "final_distance", "return"], text),
        _numbers(folder / "values.csv", ["cell", *keys, "step", "value"], text),
    )


def _model(folder: Path) -> TrainedModel:
    curve = _numbers(folder / "curve.csv", ["iteration", "loss", "validation_loss"])
    return TrainedModel(curve, int(_json(folder / "model.json", "best_iteration")["best_iteration"]))


def _translator(folder: Path) -> AssessedTranslator:
    columns = ["clip", "source", "split", *LOSSES, *YARDSTICKS]
    clips = read_table(folder / "clips.csv", columns, unique="clip")
    clips[list(YARDSTICKS)] = clips[list(YARDSTICKS)].apply(pd.to_numeric, errors="coerce")
    weights = _numbers(folder / "feature_weights.csv", ["frame", "weight"])
    return AssessedTranslator(folder, clips, weights["weight"].to_numpy())


def read_method(folder: Path) -> EvaluatedMethod:
    """Read one method's folder; AnyviewError names a broken file."""
    runs = _numbers(folder / "runs.csv", ["run", "success", "final_distance"], text=("choice",))
    curve = _numbers(folder / "curve.csv", ["iteration", "run", "final_distance", "return"])
    demonstrations = read_table(folder / "demonstrations.csv", ["clip"])["clip"]
    return EvaluatedMethod(folder, runs.sort_values("run", ignore_index=True), curve, tuple(demonstrations))


def _numbers(path: Path, columns: list[str], text: Sequence[str] = ()) -> pd.DataFrame:
    """A table whose columns are numbers; empty cells are NaN, but not in the columns that must be there.

    The columns ``text`` stay as they are.
    """
    table = read_table(path, columns)
    for column in table.columns.drop(list(text), errors="ignore"):
        written = table[column]
        table[column] = pd.to_numeric(written.replace({"True": 1, "False": 0, "": None}), errors="coerce")
        if (table[column].isna() & (written != "")).any() or (
            column in columns and table[column].isna().any()
        ):
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
