"""Ingest: a folder of raw clips becomes a set; each gets its verdict, none stops the others."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anyview.ingest.clips import Candidate, Verdict, ingest_clip, publish, read_candidates, resolve_pairs
from anyview.ingest.normalize import read_clip
from anyview.runtime.errors import AnyviewError
from anyview.video.files import read_video
from anyview.video.manifests import propose_manifest
from tests.ingest.raw_clips import LIMITS, candidate, pictures, refusal, write_raw


def test_duplicates_and_halves_of_pairs_are_refused_but_singles_are_not():
    candidates = [candidate("a.avi", "1"), candidate("b.avi", "1"), candidate("c.avi", "2")]
    candidates += [candidate("d.avi", "3"), candidate("e.avi", "3"), candidate("f.avi")]
    verdicts = [Verdict("", {}, "A"), Verdict("damaged: cut short"), Verdict("", {}, "C")]
    verdicts += [Verdict("", {}, "D"), Verdict("", {}, "C"), Verdict("", {}, "F")]
    assert [verdict.reason for verdict in resolve_pairs(candidates, verdicts)] == [
        "the other view of its pair was refused",
        "damaged: cut short",
        "",
        "the other view of its pair was refused",
        "a duplicate of c.avi",
        "",
    ]


def test_a_pair_of_which_one_view_alone_is_extreme_is_refused_and_stops_nothing():
    candidates = [
        Candidate(name, f"{name}.avi", pair, "", kind)
        for name, pair, kind in (
            ("a", "1", "standard"),
            ("b", "1", "extreme_distractor"),
            ("c", "2", "standard"),
        )
    ]
    verdicts = resolve_pairs(candidates, [Verdict("", {}, name) for name in "abc"])
    assert [verdict.reason for verdict in verdicts] == [
        *["only one view of its pair is called extreme_distractor"] * 2,
        "",
    ]


def test_a_folder_without_a_manifest_gets_one_proposed(tmp_path):
    names = [
        "day1/push-left.mp4",
        "day1/push-right.mp4",
        "extreme distractor/x_a.avi",
        "solo.mov",
        "run-2.wmv",
        "run-3-cam2.m2ts",
        "notes.txt",
    ]
    for name in names:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    with pytest.raises(AnyviewError, match=r"manifest\.csv: no such file; check manifest\.proposed\.csv"):
        read_candidates(tmp_path)
    (tmp_path / "manifest.proposed.csv").rename(tmp_path / "manifest.csv")
    rows = {c.file: (c.pair, c.camera, c.kind) for c in read_candidates(tmp_path)}
    assert rows == {
        "day1/push-left.mp4": ("day1/push", "left", "standard"),
        "day1/push-right.mp4": ("day1/push", "right", "standard"),
        "extreme distractor/x_a.avi": ("extreme distractor/x", "a", "extreme_distractor"),
        "solo.mov": ("solo", "", "standard"),
        "run-2.wmv": ("run-2", "", "standard"),
        "run-3-cam2.m2ts": ("run-3", "2", "standard"),
    }
    assert propose_manifest(tmp_path / "day1")["file"].tolist() == ["push-left.mp4", "push-right.mp4"]


@settings(max_examples=60)
@given(files=st.lists(st.text(min_size=1, max_size=12), min_size=1, max_size=6))
def test_any_names_give_ids_that_are_unique_plain_file_names(tmp_path_factory, files):
    folder = tmp_path_factory.mktemp("raw")
    pd.DataFrame({"file": files, "pair": "", "camera": "", "kind": "standard"}).to_csv(
        folder / "manifest.csv", index=False
    )
    try:
        ids = [c.clip for c in read_candidates(folder)]
    except AnyviewError:  # a name that CSV cannot carry
        return
    assert len({clip.lower() for clip in ids}) == len(ids)
    assert all(Path(clip).name == clip and not clip.startswith(".") for clip in ids)


def test_an_earlier_result_counts_only_while_clip_and_result_are_unchanged(tmp_path):
    work = tmp_path / "work"
    write_raw(tmp_path / "clip.avi", pictures())
    assert refusal(tmp_path, "clip.avi", work) == ""
    made = (work / "clip.avi").stat().st_mtime_ns
    assert refusal(tmp_path, "clip.avi", work) == ""
    assert (work / "clip.avi").stat().st_mtime_ns == made
    (work / "clip.avi").write_bytes(b"half")
    assert refusal(tmp_path, "clip.avi", work) == ""
    assert read_video(work / "clip.avi").shape == (80, 48, 48, 3)
    write_raw(tmp_path / "clip.avi", pictures()[:50])
    assert "are needed" in refusal(tmp_path, "clip.avi", work)


def test_published_clips_open_as_a_set(tmp_path):
    from anyview.video.sets import open_frames

    for name, seed in (("b.avi", 1), ("a.avi", 2)):
        write_raw(tmp_path / name, pictures(seed=seed))
    candidates = [candidate("b.avi", "1"), candidate("gone.avi"), candidate("a.avi", "2", "distractor")]
    (work := tmp_path / "work").mkdir()
    verdicts = resolve_pairs(candidates, [ingest_clip(tmp_path, work, c, LIMITS) for c in candidates])
    (out := tmp_path / "out").mkdir()
    assert publish(out, work, candidates, verdicts) == (2, 1)
    store = open_frames(out)
    assert store.manifest["clip"].tolist() == ["b", "a"]
    assert store.manifest.columns.tolist() == ["clip", "file", "pair", "camera", "kind"]
    assert pd.read_csv(out / "refused.csv").to_dict("records") == [
        {"file": "gone.avi", "pair": "gone", "reason": "no such file"}
    ]
    for row, clip in zip(store.manifest.itertuples(), store.frames, strict=True):
        raw = read_clip(tmp_path / row.file, LIMITS)
        assert np.abs(raw.astype(int) - clip).mean() < 8  # XVID


def test_the_stage_takes_a_mixed_folder_and_one_bad_clip_stops_nothing(tmp_path, root):
    raw = tmp_path / "data" / "raw" / "recorded"
    rows = []
    kinds = ((".mp4", "mp4v", 30.0), (".mov", "mp4v", 25.0), (".mkv", "XVID", 12.0), (".avi", "MJPG", 10.0))
    for index, (suffix, codec, fps) in enumerate(kinds):
        pair, camera = f"push{index // 2}", ("left", "right")[index % 2]
        frames = pictures(round(8.1 * fps), *((160, 90), (128, 96))[index % 2], seed=index)
        write_raw(raw / f"{pair}-{camera}{suffix}", frames, fps, codec)
        rows.append((f"{pair}-{camera}{suffix}", pair, camera, "standard"))
    (raw / "bad.avi").write_bytes(b"RIFF")
    rows.append(("bad.avi", "bad", "", "standard"))
    pd.DataFrame(rows, columns=["file", "pair", "camera", "kind"]).to_csv(raw / "manifest.csv", index=False)
    params = (root / "params.yaml").read_text().replace("source: surrogate", "source: recorded", 1)
    (tmp_path / "params.yaml").write_text(params)
    outputs = []
    for workers in ("1", "2"):
        shutil.rmtree(tmp_path / "data" / "clips" / "real", ignore_errors=True)
        for stage in (["ingest.py"], ["split.py", "real"]):
            done = subprocess.run(
                [sys.executable, str(root / "stages" / stage[0]), *stage[1:]],
                cwd=tmp_path,
                env=os.environ | {"ANYVIEW_WORKERS": workers, "ANYVIEW_SCRATCH": str(tmp_path / workers)},
                capture_output=True,
                text=True,
                check=False,
            )
            assert done.returncode == 0, done.stderr
            assert done.stderr == ""
        files = sorted((tmp_path / "data" / "clips" / "real").iterdir())
        outputs.append({path.name: path.read_bytes() for path in files})
    assert outputs[0] == outputs[1]
    assert pd.read_csv(tmp_path / "data/clips/real/refused.csv")["file"].tolist() == ["bad.avi"]
    split = pd.read_csv(tmp_path / "data/splits/real.csv")
    assert split["split"].value_counts().to_dict() == {"train": 2, "validation": 2}
    assert (split.groupby("pair")["split"].nunique() == 1).all()
