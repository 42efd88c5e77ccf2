"""Episodes of a LeRobotDataset become clips where they lie; what is no such data set is told in a line."""

import os
import shutil
from contextlib import suppress

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from anyview.cli.episodes import list_episodes
from anyview.ingest.clips import ingest_clip, read_candidates
from anyview.lerobot.reading import episode_views
from anyview.runtime.errors import AnyviewError
from anyview.video.files import read_video
from tests.cli.test_record_and_clips import ROOT, command, run
from tests.ingest.raw_clips import LIMITS, shrunk
from tests.lerobot.dataset import (
    LENGTHS,
    SIDE,
    TOP,
    episode,
    episodes,
    info,
    write_dataset,
    write_episodes,
    write_info,
)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    folder = tmp_path_factory.mktemp("raw") / "pushing"
    write_dataset(folder)
    return folder


@pytest.fixture
def copied(dataset, tmp_path):
    return shutil.copytree(dataset, tmp_path / "raw" / "pushing")


def test_two_cameras_of_an_episode_are_a_pair_and_ingest_takes_each_stretch(copied, tmp_path):
    """Frame k of a finished clip shows its own episode, by the same progress, none of its neighbours."""
    before = sorted(path for path in copied.rglob("*"))
    arguments = ("--from-lerobot", "raw/pushing", "--camera", TOP, "--camera", SIDE, "--raw", "raw")
    code, out, err = run("clips", *arguments, cwd=tmp_path)
    assert (code, out, err) == (0, "6 clips of 3 episodes: added to raw/manifest.csv\n", "")
    assert sorted(path for path in copied.rglob("*")) == before
    table = pd.read_csv(tmp_path / "raw" / "manifest.csv", dtype=str)
    assert table["pair"].tolist() == [f"pushing-{index:06d}" for index in (0, 0, 1, 1, 2, 2)]
    assert table["camera"].tolist() == ["top", "side"] * 3
    assert table[["start", "end"]].to_numpy().tolist()[::2] == [["0", "3"], ["3", "8"], ["0", "2.5"]]
    (work := tmp_path / "work").mkdir()
    for row, candidate in enumerate(read_candidates(tmp_path / "raw")):
        assert ingest_clip(tmp_path / "raw", work, candidate, LIMITS).reason == ""
        index, camera = row // 2, (TOP, SIDE)[row % 2]
        filmed = np.stack([shrunk(frame) for frame in episode(index, camera)])
        clip = read_video(work / f"{candidate.clip}.avi").astype(int)
        for k in (0, 20, 40, 60, 79):
            shown = np.argmin(np.abs(clip[k] - filmed).mean(axis=(1, 2, 3)))
            assert abs(shown - k * LENGTHS[index] / 80) <= 2
            assert np.abs(clip[k] - filmed[shown]).mean() < 8


def test_rows_that_are_there_stay_and_none_is_listed_twice(copied):
    raw = copied.parent
    (raw / "manifest.csv").write_text("file,pair,camera,kind,note\nown.mp4,own,left,distractor,mine\n")
    list_episodes(raw, copied, [TOP])
    list_episodes(raw, copied, [SIDE])
    table = pd.read_csv(raw / "manifest.csv", dtype=str, keep_default_na=False)
    assert table.columns.tolist() == ["file", "pair", "camera", "kind", "note", "start", "end"]
    assert table.iloc[0].tolist() == ["own.mp4", "own", "left", "distractor", "mine", "", ""]
    assert table["pair"].value_counts()["pushing-000001"] == 2
    written = (raw / "manifest.csv").read_text()
    with pytest.raises(AnyviewError, match=r"lists pushing/videos/.*file-000.mp4 already; delete its rows"):
        list_episodes(raw, copied, [TOP])
    assert (raw / "manifest.csv").read_text() == written


def test_a_data_set_may_be_the_folder_of_raw_clips_itself_but_lies_nowhere_else(copied, tmp_path):
    assert list_episodes(copied, copied, [TOP])["file"][0] == f"videos/{TOP}/chunk-000/file-000.mp4"
    (other := tmp_path / "other").mkdir()
    with pytest.raises(AnyviewError, match="lies outside of"):
        list_episodes(other, copied, [TOP])
    assert list(other.iterdir()) == []


def test_episodes_of_several_tables_are_in_order(copied):
    columns = episodes()
    write_episodes(copied, {name: values[2:] for name, values in columns.items()}, 0)
    write_episodes(copied, {name: values[:2] for name, values in columns.items()}, 1)
    table = episode_views(copied, [TOP])
    assert table["pair"].tolist() == ["pushing-000000", "pushing-000001", "pushing-000002"]


@pytest.mark.parametrize(
    ("cameras", "message"),
    [
        ([], rf"say which --camera; its cameras with video: {TOP}, {SIDE}"),
        (["top"], rf"no camera top; its cameras with video: {TOP}, {SIDE}"),
        (["observation.images.wrist"], "wrist is kept as image, not as video; its cameras with"),
        (["action"], "action is kept as float32, not as video"),
    ],
)
def test_a_camera_that_is_not_there_is_told_with_those_that_are(dataset, cameras, message):
    with pytest.raises(AnyviewError, match=message):
        episode_views(dataset, cameras)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ([], "info.json: Input should be an object"),
        ({}, "info.json: codebase_version: Field required"),
        (info() | {"features": {TOP: 3}}, "features.observation.images.top: "),
        (info() | {"codebase_version": "v2.1"}, r"version v2.1, not v3.0; convert it by .*v21_to_v30 "),
        (info() | {"video_path": "/etc/{video_key}"}, "video_path is '/etc/{video_key}', in v3.0 it is"),
        (info() | {"video_path": None}, "video_path is None"),
        (info() | {"features": {}}, "its cameras with video: none"),
    ],
)
def test_a_description_that_is_none_is_told_in_a_line(tmp_path, content, message):
    write_info(tmp_path, content)
    with pytest.raises(AnyviewError, match=message):
        episode_views(tmp_path, [TOP])


@pytest.mark.parametrize(
    ("column", "values", "message"),
    [
        ("episode_index", None, "no column episode_index"),
        (f"videos/{TOP}/from_timestamp", None, "no column videos/observation.images.top/from_timestamp"),
        (f"videos/{TOP}/from_timestamp", ["a", "b", "c"], "from_timestamp holds no numbers"),
        (f"videos/{TOP}/from_timestamp", [0.0, float("nan"), 0.0], "row 2 .*from_timestamp is nan"),
        (f"videos/{TOP}/from_timestamp", [0.0, None, 0.0], "row 2 .*from_timestamp is nan"),
        (f"videos/{TOP}/to_timestamp", [3.0, 8.0, float("inf")], "row 3 .*to_timestamp is inf"),
        (f"videos/{TOP}/to_timestamp", [3.0, 2.0, 2.5], "episode 1 of .*top starts at 3 s and ends at 2 s"),
        (f"videos/{TOP}/file_index", [0, -1, 0], "row 2 .*file_index is -1"),
        (f"videos/{TOP}/file_index", [0, 10**15, 0], r"row 2 .*file_index is 1e\+15"),
        (f"videos/{TOP}/file_index", [0.0, 0.5, 0.0], "row 2 .*file_index is 0.5"),
        (f"videos/{TOP}/file_index", [0, 7, 0], "chunk-000/file-007.mp4: no such file; download"),
        ("episode_index", [0, 1, 1], "episode 1 is listed twice"),
        ("episode_index", [0, 2**62, 1], "row 2 .*episode_index is 4.6"),
    ],
)
def test_impossible_episodes_are_told_in_a_line(copied, column, values, message):
    table = episodes()
    if values is None:
        del table[column]
    else:
        table[column] = values
    write_episodes(copied, table)
    with pytest.raises(AnyviewError, match=message):
        episode_views(copied, [TOP])


def test_what_is_no_data_set_is_told_in_a_line(tmp_path, copied):
    for folder in (tmp_path / "absent", tmp_path, copied / "meta" / "info.json"):
        with pytest.raises(AnyviewError, match=r"not a LeRobot data set: it has no meta/info.json"):
            episode_views(folder, [TOP])
    path = write_episodes(copied, {name: values[:0] for name, values in episodes().items()})
    with pytest.raises(AnyviewError, match=r"has no episodes|holds no numbers"):
        episode_views(copied, [TOP])
    path.write_bytes(b"PAR1 and nothing more")
    with pytest.raises(AnyviewError, match=r"file-000.parquet: not a Parquet table"):
        episode_views(copied, [TOP])
    path.unlink()
    with pytest.raises(AnyviewError, match=r"no episode tables \(meta/episodes/\*/\*.parquet\)"):
        episode_views(copied, [TOP])


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.floats(0, 1), value=st.integers(0, 255), cut=st.booleans())
def test_a_damaged_table_gives_possible_rows_or_a_line(copied, place, value, cut):
    path = write_episodes(copied, episodes())
    content = bytearray(path.read_bytes())
    index = round(place * (len(content) - 1))
    content[index] = value
    path.write_bytes(content[:index] if cut else content)
    with suppress(AnyviewError):
        table = episode_views(copied, [TOP, SIDE])
        assert (table["start"].astype(float) < table["end"].astype(float)).all()


def test_without_the_extra_the_command_says_how_to_install_it(copied, tmp_path):
    (hidden := tmp_path / "hidden").mkdir()
    (hidden / "pyarrow.py").write_text("raise ModuleNotFoundError('no pyarrow', name='pyarrow')")
    process = command(
        *("clips", "--from-lerobot", str(copied), "--camera", TOP, "--raw", str(copied)),
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": f"{hidden}:{ROOT / 'src'}"},
    )
    _, err = process.communicate()
    assert process.returncode == 2
    assert err == "error: no pyarrow; pip install 'anyview[lerobot]'\n"
