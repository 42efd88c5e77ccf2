"""`anyview translate`, as a user runs it."""

import json
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
import torch

from anyview.assessment.evaluation import translate_clip
from anyview.cli.footage import read_view
from anyview.cli.translate import translate
from anyview.runtime.errors import AnyviewError
from anyview.translator.network import ContextTranslator
from anyview.translator.weights import load_translator, save_translator
from anyview.video.files import read_video, write_video
from anyview.video.sets import write_clips, write_set
from tests.training.discworld import disc_clips


def anyview_translate(clip: str, *options: str) -> subprocess.CompletedProcess[str]:
    """Translate ``clip`` into the view `view.png` by the model `mine`."""
    command = [sys.executable, "-m", "anyview", "translate", clip, "--context", "view.png", "--model", "mine"]
    return subprocess.run([*command, *options], capture_output=True, text=True)


@pytest.fixture
def footage(tmp_path, monkeypatch) -> None:
    """In the working folder: a model, a clip of its size, a wide clip, and another view of it."""
    monkeypatch.chdir(tmp_path)
    torch.manual_seed(5)
    save_translator(tmp_path / "data/models/mine", ContextTranslator("compact", 16), {})
    clips = disc_clips(2, length=9)
    write_video(tmp_path / "clip.avi", clips[0], 15.0)
    wide = np.pad(clips[0], ((0, 0), (0, 0), (8, 8), (0, 0)))
    write_video(tmp_path / "wide.avi", wide, 15.0)
    cv2.imwrite(str(tmp_path / "view.png"), clips[1, 0][..., ::-1])
    write_video(tmp_path / "view.avi", clips[1], 15.0)


def test_translating_a_clip_of_ones_own(footage):
    ended = anyview_translate("clip.avi", "-o", "out.avi")
    assert ended.returncode == 0, ended.stderr
    assert "9 frames" in ended.stdout
    model = load_translator(Path("data/models/mine"))
    clip, view = disc_clips(2, length=9)
    assert np.array_equal(read_video(Path("out.avi")), translate_clip(model, clip, view[0]))
    assert cv2.VideoCapture("out.avi").get(cv2.CAP_PROP_FPS) == pytest.approx(15)
    again = anyview_translate("clip.avi", "--json")
    assert json.loads(again.stdout) == {"output": "translated.avi", "frames": 9, "size": 16, "rate": 15.0}
    assert Path("translated.avi").read_bytes() == Path("out.avi").read_bytes()


def test_bad_footage_is_refused_in_one_line(footage):
    ended = anyview_translate("absent.avi", "-o", "out.avi")
    complaint = "error: absent.avi: no such file, and no clip of a set in data/clips\n"
    assert (ended.returncode, ended.stderr) == (2, complaint)


def test_a_view_that_claims_a_giant_picture_is_refused(tmp_path):
    content = bytearray(cv2.imencode(".png", np.zeros((8, 8, 3), np.uint8))[1])
    content[16:24] = struct.pack(">II", 100_000, 100_000)
    content[29:33] = struct.pack(">I", zlib.crc32(content[12:29]))
    path = tmp_path / "view.png"
    path.write_bytes(content)
    with pytest.raises(AnyviewError, match=r"view\.png: damaged"):
        read_view(path, 48)


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
def test_a_damaged_view_is_refused(tmp_path, suffix):
    picture = np.random.default_rng(0).integers(0, 255, (120, 120, 3), np.uint8)
    content = bytearray(cv2.imencode(suffix, picture)[1])
    whole, path = bytes(content), tmp_path / f"view{suffix}"
    content[len(content) // 2 : len(content) // 2 + 300] = bytes(300)
    for damaged in (bytes(content), whole[: len(whole) // 2]):
        path.write_bytes(damaged)
        with pytest.raises(AnyviewError, match=r"view\.(jpg|png): .*damaged"):
            read_view(path, 48)
    path.write_bytes(whole)
    assert read_view(path, 48).shape == (48, 48, 3)


def test_wide_clips_are_cut_to_their_middle_and_a_clip_may_be_the_context(footage):
    for clip, context, output in (("clip.avi", "view.png", "a.avi"), ("wide.avi", "view.avi", "b.avi")):
        translate(clip, Path(context), Path("mine"), Path(output))
    assert np.array_equal(read_video(Path("a.avi")), read_video(Path("b.avi")))


def test_a_clip_of_a_set_is_called_by_its_name(footage):
    clips = disc_clips(2, length=9)
    folder = Path("data/clips/discs")
    folder.mkdir(parents=True)
    write_set(
        folder, pd.DataFrame({"clip": ["one", "two"]}), [write_clips(folder / "shard-0000.avi", clips, 15.0)]
    )
    for clip, output in (("clip.avi", "a.avi"), ("one", "b.avi")):
        translate(clip, Path("view.png"), Path("mine"), Path(output))
    assert np.array_equal(read_video(Path("a.avi")), read_video(Path("b.avi")))


@pytest.mark.parametrize(
    "changed",
    [
        {"clip": "text.avi"},
        {"clip": "cut.avi"},
        {"context": "text.png"},
        {"context": "empty.png"},
        {"context": "absent.png"},
        {"model": "other"},
        {"output": "out.mp4"},
        {"output": "no/out.avi"},
    ],
    ids=lambda changed: next(iter(changed.values())),
)
def test_what_is_wrong_is_named(footage, changed):
    for name in ("text.png", "text.avi"):
        Path(name).write_text("not a picture")
    Path("empty.png").touch()
    content = Path("clip.avi").read_bytes()
    Path("cut.avi").write_bytes(content[: len(content) // 2])
    given = {"clip": "clip.avi", "context": "view.png", "model": "mine", "output": "out.avi"} | changed
    with pytest.raises(AnyviewError, match=next(iter(changed.values()))):
        translate(given.pop("clip"), **{name: Path(value) for name, value in given.items()})
    assert not Path("out.avi").exists()
