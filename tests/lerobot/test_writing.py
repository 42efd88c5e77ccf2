"""A set of clips as a LeRobotDataset, read back by its documented layout, and by the library where it is."""

import json
from pathlib import Path

import av
import numpy as np
import pandas as pd
import pyarrow.parquet as parquet
import pytest

from anyview.cli.episodes import export_set
from anyview.ingest.clips import ingest_clip, read_candidates
from anyview.lerobot.writing import write_dataset
from anyview.runtime.errors import AnyviewError
from anyview.video.files import read_video
from anyview.video.sets import write_clips, write_set, write_shard
from tests.cli.test_record_and_clips import run
from tests.ingest.raw_clips import LIMITS, pictures, shrunk

# Which camera saw which demonstration: the third was seen by one of them alone.
VIEWS = (("push-1", "left"), ("push-1", "right"), ("push-2", "right"), ("push-2", "left"), ("push-3", "left"))
FRAMES = 20


def clip(seed: int) -> np.ndarray:
    return np.stack([shrunk(frame) for frame in pictures(FRAMES, seed=seed)]).round().astype(np.uint8)


@pytest.fixture(scope="module")
def ingested(tmp_path_factory) -> Path:
    """A set as ingest leaves it, losslessly, so that what is read back can be compared."""
    folder = tmp_path_factory.mktemp("ingested")
    rows = [
        {"clip": f"c{index}", "file": f"c{index}.avi", "pair": pair, "camera": camera, "kind": "standard"}
        for index, (pair, camera) in enumerate(VIEWS)
    ]
    files = [write_clips(folder / row["file"], clip(n)[None], 10.0) for n, row in enumerate(rows)]
    write_set(folder, pd.DataFrame(rows), files)
    return folder


@pytest.fixture(scope="module")
def simulated(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("simulated")
    shards = [write_shard(folder, n, np.stack([clip(2 * n), clip(2 * n + 1)])) for n in range(2)]
    write_set(folder, pd.DataFrame({"clip": [f"d{n}" for n in range(4)], "success": True}), shards)
    return folder


def episode_frames(folder: Path, camera: str, episode: int) -> np.ndarray:
    """What the tables of the data set say that ``camera`` saw of an episode, uint8 RGB (T, H, W, 3)."""
    info = json.loads((folder / "meta" / "info.json").read_text())
    table = pd.concat([pd.read_parquet(path) for path in sorted(folder.glob("meta/episodes/*/*.parquet"))])
    row = table.set_index("episode_index").loc[episode]
    key = f"observation.images.{camera}"
    path = folder / info["video_path"].format(
        video_key=key,
        chunk_index=row[f"videos/{key}/chunk_index"],
        file_index=row[f"videos/{key}/file_index"],
    )
    begin, end = row[f"videos/{key}/from_timestamp"], row[f"videos/{key}/to_timestamp"]
    assert end - begin == pytest.approx(row["length"] / info["fps"])
    with av.open(str(path)) as video:
        decoded = [(frame.time, frame.to_ndarray(format="rgb24")) for frame in video.decode(video=0)]
    chosen = [(time, frame) for time, frame in decoded if begin - 1e-4 <= time < end - 1e-4]
    assert [time - begin for time, _ in chosen] == pytest.approx(
        np.arange(row["length"]) / info["fps"], abs=1e-4
    )
    return np.stack([frame for _, frame in chosen])


def assert_shows(found: np.ndarray, expected: np.ndarray) -> None:
    """The same clip, but for what the codec loses, and frame by frame: others look less alike."""
    assert found.shape == expected.shape
    apart = np.abs(found.astype(int)[:, None] - expected[None]).mean(axis=(2, 3, 4))
    assert np.diag(apart).max() < 6
    assert np.abs(apart.argmin(axis=1) - np.arange(len(found))).max() <= 1  # the disc is slow


def test_a_pair_becomes_an_episode_with_two_cameras(ingested, tmp_path):
    code, out, err = run(
        "export", str(ingested), "out", "--format", "lerobot", "--task", "push", cwd=tmp_path
    )
    assert (code, err) == (0, "")
    assert out.endswith("out: 2 episodes; 1 left out that a camera did not see (see --camera)\n")
    for episode, (left, right) in enumerate(((0, 1), (3, 2))):
        assert_shows(episode_frames(tmp_path / "out", "left", episode), clip(left))
        assert_shows(episode_frames(tmp_path / "out", "right", episode), clip(right))
    info = json.loads((tmp_path / "out" / "meta" / "info.json").read_text())
    assert (info["codebase_version"], info["fps"], info["splits"]) == ("v3.0", 10, {"train": "0:2"})
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (2, 2 * FRAMES, 1)
    assert info["features"]["observation.images.left"]["shape"] == [48, 48, 3]
    assert not [name for name in info["features"] if "action" in name or "state" in name]
    tasks = pd.read_parquet(tmp_path / "out" / "meta" / "tasks.parquet")
    assert tasks.loc["push", "task_index"] == 0


def test_one_camera_can_be_asked_for_alone(ingested, tmp_path):
    assert export_set(ingested, tmp_path / "out", ["left"], "push") == (3, 0)
    for episode, source in enumerate((0, 3, 4)):
        assert_shows(episode_frames(tmp_path / "out", "left", episode), clip(source))


def test_a_simulated_set_has_one_view_and_its_frames_are_listed(simulated, tmp_path):
    assert export_set(simulated, tmp_path / "out", [], "push") == (4, 0)
    rows = parquet.read_table(tmp_path / "out" / "data" / "chunk-000" / "file-000.parquet")
    assert {field.name: str(field.type) for field in rows.schema} == {
        "timestamp": "float",
        "frame_index": "int64",
        "episode_index": "int64",
        "index": "int64",
        "task_index": "int64",
    }
    for row in rows.to_pylist():
        assert row["index"] == row["episode_index"] * FRAMES + row["frame_index"]
        assert row["timestamp"] == pytest.approx(row["frame_index"] / 10)
    assert [row["index"] for row in rows.to_pylist()] == list(range(4 * FRAMES))
    table = pd.read_parquet(tmp_path / "out" / "meta" / "episodes" / "chunk-000" / "file-000.parquet")
    bounds = table[["dataset_from_index", "dataset_to_index"]].to_numpy().tolist()
    assert bounds == [[n * FRAMES, (n + 1) * FRAMES] for n in range(4)]
    for episode in range(4):
        assert_shows(episode_frames(tmp_path / "out", "view", episode), clip(episode))


def test_many_episodes_are_spread_over_files(tmp_path):
    frames = np.stack([clip(seed) for seed in range(5)])
    order = np.array([[4], [2], [0], [1], [3]])
    write_dataset(tmp_path, frames, order, ["top"], 12.5, "push", episodes_per_file=2)
    assert len(list(tmp_path.glob("videos/observation.images.top/chunk-000/file-00[012].mp4"))) == 3
    for episode, (source,) in enumerate(order):
        assert_shows(episode_frames(tmp_path, "top", episode), frames[source])


def test_statistics_are_those_of_the_frames(tmp_path):
    frames = np.stack([clip(seed) for seed in range(3)])
    write_dataset(tmp_path, frames, np.array([[0], [2]]), ["top"], 10.0, "push")
    found = json.loads((tmp_path / "meta" / "stats.json").read_text())
    shown = frames[[0, 2]].reshape(-1, 3) / 255
    expected = {
        "min": shown.min(0),
        "max": shown.max(0),
        "mean": shown.mean(0),
        "std": shown.std(0),
        **{
            f"q{q:02d}": np.quantile(shown, q / 100, axis=0, method="inverted_cdf")
            for q in (1, 10, 50, 90, 99)
        },
    }
    camera = found["observation.images.top"]
    assert camera.pop("count") == [2 * FRAMES]
    assert camera.keys() == expected.keys()
    for name, values in expected.items():
        np.testing.assert_allclose(camera[name], values.reshape(3, 1, 1), atol=1e-9)
    assert found["timestamp"]["max"] == pytest.approx([(FRAMES - 1) / 10])


def test_what_was_exported_comes_back_as_the_same_pairs(ingested, tmp_path):
    raw = tmp_path / "raw"
    export_set(ingested, raw / "back", [], "push")
    cameras = [f"--camera=observation.images.{name}" for name in ("left", "right")]
    assert run("clips", "--from-lerobot", "raw/back", *cameras, "--raw", "raw", cwd=tmp_path)[0] == 0
    (work := tmp_path / "work").mkdir()
    candidates = read_candidates(raw)
    assert [(each.pair, each.camera) for each in candidates] == [
        (f"back-{episode:06d}", camera) for episode in (0, 1) for camera in ("left", "right")
    ]
    for candidate, source in zip(candidates, (0, 1, 3, 2), strict=True):
        assert ingest_clip(raw, work, candidate, LIMITS).reason == ""
        finished = read_video(work / f"{candidate.clip}.avi")
        assert_shows(finished[:: 80 // FRAMES], clip(source))


def test_the_library_opens_it(ingested, tmp_path):
    library = pytest.importorskip("lerobot.datasets.lerobot_dataset")
    export_set(ingested, tmp_path / "out", [], "push")
    dataset = library.LeRobotDataset("local/pushing", root=tmp_path / "out", video_backend="pyav")
    assert (dataset.num_episodes, dataset.num_frames, dataset.fps) == (2, 2 * FRAMES, 10)
    item = dataset[FRAMES + 7]
    assert item["task"] == "push"
    shown = item["observation.images.left"].permute(1, 2, 0).numpy() * 255
    assert np.abs(shown - clip(3)[7]).mean() < 6


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["absent", "out"], "data/clips/absent/manifest.csv: no such file"),
        (["{set}", "{set}"], "exists already; name a new folder"),
        (["{set}", "out", "--camera", "top"], "no camera top; it has left, right"),
        (["{set}", "out", "--format", "odd"], "Invalid value for '--format'"),
    ],
)
def test_what_cannot_be_exported_is_told_and_leaves_nothing(ingested, tmp_path, arguments, message):
    code, _, err = run("export", *(each.format(set=ingested) for each in arguments), cwd=tmp_path)
    assert code == 2
    assert message in " ".join(err.replace("│", " ").split())
    assert "Traceback" not in err
    assert list(tmp_path.iterdir()) == []


def test_views_that_make_no_episode_are_told(ingested, tmp_path):
    manifest = pd.read_csv(ingested / "manifest.csv")
    for name, pairs, cameras, message in (
        ("twice", manifest["pair"], "left", "pair push-1 has two clips of camera left"),
        ("alone", manifest["clip"], manifest["camera"], "no demonstration was seen by all of left, right"),
    ):
        (folder := tmp_path / name).mkdir()
        for path in ingested.iterdir():
            (folder / path.name).write_bytes(path.read_bytes())
        manifest.assign(pair=pairs, camera=cameras).to_csv(folder / "manifest.csv", index=False)
        with pytest.raises(AnyviewError, match=message):
            export_set(folder, tmp_path / "out", [], "push")
    assert not (tmp_path / "out").exists()
