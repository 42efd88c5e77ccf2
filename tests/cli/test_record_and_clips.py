"""`anyview record` and `anyview clips`, run as a user runs them, video files standing for webcams."""

import json
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from urllib.error import HTTPError

import cv2
import numpy as np
import pandas as pd
import pytest

from anyview.ingest.normalize import read_clip
from anyview.video.files import read_video
from tests.ingest.raw_clips import LIMITS, pictures, write_raw

ROOT = Path(__file__).parents[2]


def command(*arguments: str, cwd: Path, **options) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-c", "from anyview.cli.main import main; main()", *arguments],
        cwd=cwd,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )


def run(*arguments: str, cwd: Path) -> tuple[int, str, str]:
    process = command(*arguments, cwd=cwd)
    out, err = process.communicate("", timeout=120)
    return process.returncode, out, err


@pytest.fixture(scope="module")
def sources(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("sources")
    write_raw(folder / "a.mp4", pictures(165), 20.0, "mp4v")
    write_raw(folder / "b.avi", pictures(125, 128, 96), 15.0)
    write_raw(folder / "slow.avi", pictures(82), 5.0)
    write_raw(folder / "short.avi", pictures(20), 10.0)
    content = write_raw(folder / "damaged.avi", pictures(90), 10.0).read_bytes()
    at = [found.end() for found in re.finditer(b"00dc", content)][20] + 4  # where the 20th frame's bits begin
    (folder / "damaged.avi").write_bytes(content[:at] + bytes(60) + content[at + 60 :])
    return folder


def test_two_views_are_filmed_at_once_and_ingest_takes_them(tmp_path, sources):
    code, out, err = run(
        *("record", "raw", "--pair", "p1", "--kind", "distractor", "--delay", "0"),
        *("--camera", f"left={sources / 'a.mp4'}", "--camera", f"right={sources / 'b.avi'}"),
        cwd=tmp_path,
    )
    assert (code, err) == (0, "")
    raw = tmp_path / "raw"
    assert pd.read_csv(raw / "manifest.csv").to_numpy().tolist() == [
        ["p1-left.avi", "p1", "left", "distractor"],
        ["p1-right.avi", "p1", "right", "distractor"],
    ]
    for name, size in (("left", (90, 160)), ("right", (96, 128))):
        assert read_video(raw / f"p1-{name}.avi").shape == (80, *size, 3)  # the camera's own resolution
        assert cv2.imread(str(raw / f"p1-{name}.png")).shape == (*size, 3)
        assert f"p1-{name}.png" in out
        assert read_clip(raw / f"p1-{name}.avi", LIMITS).shape == (80, 48, 48, 3)
    code, out, err = run(
        "record", "raw", "--camera", f"left={sources / 'a.mp4'}", "--pair", "p1", cwd=tmp_path
    )
    assert code == 2
    assert "pair p1 is there already" in err


def test_json_tells_a_script_what_was_filmed(tmp_path, sources):
    """And nothing else stands on standard output; a length that ingest refuses is noted beside it."""
    shutil.copy(ROOT / "params.yaml", tmp_path)
    arguments = ("--delay", "0.1", "--seconds", "1", "--camera", f"left={sources / 'a.mp4'}")
    code, out, err = run("record", "raw", "--json", *arguments, cwd=tmp_path)
    assert code == 0
    assert json.loads(out) == {
        "folder": "raw",
        "pair": "demo-001",
        "kind": "standard",
        "clips": [{"camera": "left", "file": "demo-001-left.avi", "still": "demo-001-left.png"}],
    }
    assert {path.name for path in (tmp_path / "raw").iterdir()} >= {"demo-001-left.avi", "demo-001-left.png"}
    assert "note: stage ingest takes clips of" in err


def test_a_clip_that_a_kill_kept_out_of_the_manifest_is_in_nobodys_way(tmp_path, sources):
    (tmp_path / "demo-001-left.avi").write_bytes(b"whole, but not listed")
    arguments = ("record", ".", "--delay", "0", "--seconds", "1", "--camera", f"left={sources / 'a.mp4'}")
    assert run(*arguments, cwd=tmp_path)[0] == 0
    assert pd.read_csv(tmp_path / "manifest.csv")["pair"].tolist() == ["demo-002"]
    code, _, err = run(*arguments, "--pair", "demo-001", cwd=tmp_path)
    assert code == 2
    assert "demo-001-left.avi: exists, but not in the manifest; delete it or choose another --pair" in err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--camera", "left={}/absent.mp4"], "absent.mp4: no such file"),
        (["--camera", "left={}"], "no such file"),
        (["--camera", "left=77"], "camera left: 77 gives no picture"),
        (["--camera", "left=99999999999"], "camera left: 99999999999: no such device"),
        (["--camera", "left=²"], "²: no such file"),
        (["--camera", "left"], "--camera left: write NAME=SOURCE"),
        (["--camera", "left={}/a.mp4", "--camera", "left={}/b.avi"], "give each another name"),
        (["--camera", "../x={}/a.mp4"], "'../x': a name has only"),
        (["--camera", "left={}/a.mp4", "--pair", "../../x"], "'../../x': a name has only"),
        (["--camera", "left={}/a.mp4", "--kind", "odd"], "kind odd: must be one of standard"),
        (["--camera", "left={}/short.avi"], "camera left: the file ends too early"),
        (["--camera", "left={}/damaged.avi"], r"damaged.avi: damaged: frame 2\d cannot"),
        (
            ["--camera", "left={}/slow.avi", "--seconds", "2"],
            r"camera left: [45]\.\d frames a second, 10 are needed",
        ),
    ],
)
def test_what_goes_wrong_is_said_in_one_line_and_leaves_no_clip(tmp_path, sources, arguments, message):
    filled = [argument.format(sources) for argument in arguments]
    code, _, err = run("record", "raw", "--delay", "0", *filled, cwd=tmp_path)
    assert code == 2
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert re.search(message, err)
    assert not [path for path in tmp_path.rglob("*") if path.suffix in (".avi", ".csv")]


def test_ctrl_c_leaves_manifest_and_folder_as_they_were(tmp_path, sources):
    (tmp_path / "manifest.csv").write_text("file,pair,camera,kind\nold.avi,old,left,standard\n")
    process = command("record", ".", "--delay", "0", "--camera", f"left={sources / 'a.mp4'}", cwd=tmp_path)
    while not list(tmp_path.glob(".*partial*.avi")):
        assert process.poll() is None
        time.sleep(0.05)
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert err.splitlines()[0] == "interrupted: no clip was kept"
    assert (tmp_path / "manifest.csv").read_text().count("\n") == 2
    assert [path.name for path in tmp_path.glob("*.avi")] == []
    assert [path.name for path in tmp_path.glob(".*")] == []


def test_the_preview_shows_the_views_on_loopback_and_waits_for_enter(tmp_path, sources):
    process = command(
        *("record", "raw", "--preview", "--port", "0", "--delay", "0", "--seconds", "2"),
        *("--camera", f"left={sources / 'a.mp4'}"),
        cwd=tmp_path,
    )
    address = re.search(r"http://127\.0\.0\.1:\d+/", process.stdout.readline()).group()
    assert 'src="/0.mjpg"' in urllib.request.urlopen(address, timeout=10).read().decode()
    with urllib.request.urlopen(address + "0.mjpg", timeout=10) as stream:
        start = stream.read(4000)
    assert start.startswith(b"--frame\r\nContent-Type: image/jpeg")
    picture = start.partition(b"\r\n\r\n")[2]
    assert picture.startswith(b"\xff\xd8")
    for url, headers, status in (
        (address, {"Host": "elsewhere.example"}, 403),
        (address + "1.mjpg", {}, 404),
    ):
        with pytest.raises(HTTPError) as refused:
            urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=10)
        assert refused.value.code == status
    port = int(address.rstrip("/").rpartition(":")[2])
    assert listening_addresses(port) == {"0100007F"}  # 127.0.0.1
    assert not (tmp_path / "raw" / "manifest.csv").exists()
    _, err = process.communicate("\n", timeout=60)
    assert (process.returncode, err) == (0, "")
    assert (tmp_path / "raw" / "manifest.csv").exists()


def test_a_port_that_is_taken_is_told(tmp_path, sources):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        arguments = ("--preview", "--port", port, "--camera", f"left={sources / 'a.mp4'}")
        code, _, err = run("record", "raw", *arguments, cwd=tmp_path)
    assert (code, err) == (
        2,
        f"error: --port {port}: Address already in use; choose another, or 0 for a free one\n",
    )


def listening_addresses(port: int) -> set[str]:
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    return {row[1].split(":")[0] for row in rows if row[3] == "0A" and int(row[1].split(":")[1], 16) == port}


def test_a_full_disk_is_reported_and_leaves_no_clip(tmp_path, sources):
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=96k", "tmpfs", str(disk)], capture_output=True
    )
    if mounted.returncode:
        pytest.skip("mounting a small disk takes privileges")
    try:
        code, _, err = run(
            "record", str(disk), "--delay", "0", "--camera", f"left={sources / 'a.mp4'}", cwd=tmp_path
        )
        assert code == 2
        assert re.search("disk full|No space left", err)
        assert not list(disk.glob("*.avi")) + list(disk.glob("*.csv")) + list(disk.glob(".*"))
    finally:
        subprocess.run(["umount", str(disk)], check=True)


def test_clips_lists_sets_splits_and_refusals_and_writes_a_sheet(tmp_path, root):
    from anyview.video.sets import write_clips, write_set

    (tmp_path / "params.yaml").write_text((root / "params.yaml").read_text())
    folder = tmp_path / "data" / "clips" / "real"
    folder.mkdir(parents=True)
    rows, files = [], []
    for index, kind in enumerate(["standard", "standard", "extreme_distractor"]):
        clip = pictures(10, 48, 48, seed=index)
        files.append(write_clips(folder / f"c{index}.avi", clip[None], 10.0, "XVID"))
        rows.append(
            {"clip": f"c{index}", "file": f"c{index}.avi", "pair": f"p{index}", "camera": "", "kind": kind}
        )
    write_set(folder, pd.DataFrame(rows), files)
    (folder / "refused.csv").write_text('file,pair,reason\nbad.mp4,bad,"damaged: cut short"\n')
    (tmp_path / "data" / "splits").mkdir()
    (tmp_path / "data" / "splits" / "real.csv").write_text("clip,pair,split\nc0,p0,train\nc2,p2,extreme\n")
    code, out, err = run("clips", "--sheet", "sheet.png", cwd=tmp_path)
    assert (code, err) == (0, "")
    assert "bad.mp4: damaged: cut short (pair bad)" in out
    sheet = cv2.imread(str(tmp_path / "sheet.png"))
    assert np.abs(sheet[:48, :48, ::-1].astype(int) - pictures(10, 48, 48, seed=0)[0]).mean() < 8
    code, out, _ = run("clips", "--json", cwd=tmp_path)
    found = json.loads(out)
    assert found["sets"]["real"] == {"train": 1, "validation": 0, "extreme": 1, "unused": 1}
    assert found["kinds"]["standard"] == {"train": 1, "validation": 0, "extreme": 0, "unused": 1}
    assert found["refused"] == [{"file": "bad.mp4", "pair": "bad", "reason": "damaged: cut short"}]
    for arguments, said in (
        (["--propose", "--sheet", "sheet.png"], "--sheet shows ingested clips"),
        (["--propose", "--from-lerobot", "."], "--propose and --from-lerobot"),
        (["--camera", "top"], "--camera names those of a LeRobotDataset"),
    ):
        code, _, err = run("clips", *arguments, cwd=tmp_path)
        assert (code, err.count("\n")) == (2, 1)
        assert err.startswith(f"error: {said}")
    code, _, err = run("clips", "--sheet", "sheet.gif", cwd=tmp_path)
    assert (code, err) == (2, "error: sheet.gif: a contact sheet is a .png file\n")
