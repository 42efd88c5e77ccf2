"""Video files as cameras, phones and editing programs leave them, and the table of them in docs/formats.md.

python -m tests.ingest.formats      # tries each and writes the table
"""

import os
import tempfile
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import av
import cv2
import numpy as np

from tests.ingest.raw_clips import pictures, refusal

os.environ["SVT_LOG"] = "1"  # the encoder of AV1 tells its whole configuration
DOCUMENT = Path(__file__).parents[2] / "docs" / "formats.md"
_INTRODUCTION = """# Video files that ingest takes

Each row was tried: a test writes a clip of this kind and ingests it. `good` means that it became a clip of
80 right frames. Otherwise the result is the reason that `refused.csv` gives. `python -m tests.ingest.formats`
tries all of them and writes this page.

| what | file | video | result |
|---|---|---|---|
"""


class Filmed(NamedTuple):
    """A kind of clip: what is special about it, its file, its codec, and how it is written."""

    what: str
    file: str
    codec: str
    write: Callable[[Path], object]


def encode(
    path: Path,
    frames: np.ndarray,
    codec: str,
    fps: float = 25.0,
    pixels: str = "yuv420p",
    options: dict[str, str] | None = None,
    turn: int = 0,
    aspect: Fraction | None = None,
    sound: float = 0.0,
    begin: float = 0.0,
) -> None:
    """Write ``frames``, uint8 RGB (T, H, W, 3), that a player turns by ``turn`` degrees counterclockwise.

    The sound lasts ``sound`` seconds, and the file's clock begins at ``begin`` seconds.
    """
    names = {".mts": "mpegts", ".ts": "mpegts", ".mpg": "mpeg", ".vob": "vob"}
    with av.open(str(path), "w", format=names.get(path.suffix.lower())) as container:
        stream = container.add_stream(codec, Fraction(fps).limit_denominator(1001), options or {})
        stream.height, stream.width = frames.shape[1:3]
        stream.pix_fmt = pixels
        stream.codec_context.thread_count = 1
        if turn:
            stream.set_display_rotation(turn)
        if aspect:
            stream.codec_context.sample_aspect_ratio = aspect
        if sound:
            audio = container.add_stream("aac", 8000)
            silence = av.AudioFrame.from_ndarray(
                np.zeros((1, round(sound * 8000)), np.float32), "fltp", "mono"
            )
            silence.sample_rate, silence.pts = 8000, 0
        for index, frame in enumerate(frames):
            picture = av.VideoFrame.from_ndarray(frame, "rgb24")
            picture.pts, picture.time_base = (
                index + round(begin * fps),
                1 / Fraction(fps).limit_denominator(1001),
            )
            container.mux(stream.encode(picture))
        container.mux(stream.encode())
        if sound:
            container.mux(audio.encode(silence))
            container.mux(audio.encode())


def copy(source: Path, target: Path, first: int) -> None:
    """Trim a video without encoding it anew: the packets from number ``first`` on."""
    with av.open(str(source)) as film, av.open(str(target), "w") as trimmed:
        stream = trimmed.add_stream_from_template(film.streams.video[0])
        origin = None
        for index, packet in enumerate(film.demux(video=0)):
            if index >= first and packet.dts is not None:
                origin = packet.dts if origin is None else origin
                packet.pts, packet.dts = packet.pts - origin, packet.dts - origin
                packet.stream = stream
                trimmed.mux(packet)


def interlaced(frames: np.ndarray) -> np.ndarray:
    """Half as many frames: the even lines of each second one, the odd lines of the one after it."""
    woven = frames[::2].copy()
    woven[:, 1::2] = frames[1::2, 1::2]
    return woven


def scene(fps: float, width: int = 160, height: int = 96) -> np.ndarray:
    """A demonstration of 8.2 seconds at any rate, uint8 RGB (T, height, width, 3)."""
    return pictures(round(8.2 * fps), width, height)


def _x264(**options: object) -> dict[str, str]:
    return {"x264-params": ":".join(f"{key}={value}" for key, value in {"threads": 1, **options}.items())}


def _from_a_longer_film(path: Path) -> None:
    long = path.with_name("long" + path.suffix)
    frames = np.concatenate([scene(25)[:1].repeat(7, axis=0), scene(25)])
    encode(long, frames, "libx264", options=_x264(keyint=10, scenecut=0, bframes=0))
    copy(long, path, 7)
    long.unlink()


def _link(path: Path) -> None:
    (path.parent / "cards").mkdir()
    encode(path.parent / "cards" / "clip.mp4", scene(25), "libx264")
    path.symlink_to(Path("cards", "clip.mp4"))


def _half(path: Path) -> None:
    encode(path, scene(25), "libx264")
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def _resized(frames: np.ndarray, width: int, height: int) -> np.ndarray:
    return np.stack([cv2.resize(frame, (width, height)) for frame in frames])


KINDS = (
    Filmed("a phone", "a.mp4", "H.264", lambda path: encode(path, scene(29.97), "libx264", 29.97)),
    Filmed(
        "a newer phone",
        "b.mov",
        "HEVC, 10 bits a channel",
        lambda path: encode(
            path,
            scene(25),
            "libx265",
            pixels="yuv420p10le",
            options={"x265-params": "log-level=none:pools=1"},
        ),
    ),
    Filmed(
        "a phone of today, and LeRobot",
        "c.mp4",
        "AV1",
        lambda path: encode(path, scene(25), "libsvtav1", options={"preset": "9"}),
    ),
    Filmed(
        "a phone held upright (rotation in the file)",
        "d.mp4",
        "H.264",
        lambda path: encode(path, np.rot90(scene(25), 1, (1, 2)), "libx264", turn=-90),
    ),
    Filmed(
        "pixels that are not square",
        "e.mp4",
        "H.264",
        lambda path: encode(path, scene(25)[:, :, ::2], "libx264", aspect=Fraction(2)),
    ),
    Filmed("240 frames a second", "f.mp4", "H.264", lambda path: encode(path, scene(240), "libx264", 240)),
    Filmed(
        "a camcorder, interlaced",
        "g.mts",
        "H.264",
        lambda path: encode(
            path, interlaced(scene(50)), "libx264", options=_x264(tff=1) | {"flags": "+ildct+ilme"}
        ),
    ),
    Filmed(
        "a camcorder, interlaced",
        "h.mpg",
        "MPEG-2",
        lambda path: encode(path, interlaced(scene(50)), "mpeg2video", options={"flags": "+ildct+ilme"}),
    ),
    Filmed(
        "a camcorder with tapes, interlaced",
        "i.dv",
        "DV",
        lambda path: encode(path, _resized(scene(25)[:, :, 16:-16], 720, 576), "dvvideo"),
    ),
    Filmed(
        "a webcam",
        "j.avi",
        "MJPEG",
        lambda path: encode(path, scene(15), "mjpeg", 15, "yuvj422p"),
    ),
    Filmed(
        "a browser, with transparency",
        "k.webm",
        "VP9",
        lambda path: encode(
            path,
            scene(25),
            "libvpx-vp9",
            pixels="yuva420p",
            options={"deadline": "realtime", "cpu-used": "8"},
        ),
    ),
    Filmed(
        "an editing program",
        "l.mov",
        "ProRes",
        lambda path: encode(path, scene(25), "prores_ks", 25, "yuv422p10le"),
    ),
    Filmed("Windows", "m.wmv", "WMV 8", lambda path: encode(path, scene(25), "wmv2", options={"b": "1M"})),
    Filmed("Flash", "n.flv", "Sorenson", lambda path: encode(path, scene(25), "flv", options={"b": "1M"})),
    Filmed(
        "an old phone",
        "o.3gp",
        "H.263",
        lambda path: encode(path, _resized(scene(25)[:, :, 16:-16], 176, 144), "h263", options={"b": "1M"}),
    ),
    Filmed(
        "a screen recorder",
        "p.mkv",
        "MPEG-4",
        lambda path: encode(path, scene(25), "mpeg4", options={"b": "1M"}),
    ),
    Filmed(
        "a transport stream whose clock starts at 582 s",
        "q.ts",
        "H.264",
        lambda path: encode(path, scene(25), "libx264", begin=582.0),
    ),
    Filmed("cut out of a longer film, first frame not a key frame", "r.mkv", "H.264", _from_a_longer_film),
    Filmed("cut out of a longer film, first frame not a key frame", "s.mp4", "H.264", _from_a_longer_film),
    Filmed(
        "sound that lasts longer than the picture",
        "t.mp4",
        "H.264",
        lambda path: encode(path, scene(25), "libx264", sound=11.0),
    ),
    Filmed(
        "sound that lasts longer than the picture",
        "u.mkv",
        "H.264",
        lambda path: encode(path, scene(25), "libx264", sound=11.0),
    ),
    Filmed(
        "a name with spaces and umlauts",
        "mein Löffel 2.mp4",
        "H.264",
        lambda path: encode(path, scene(25), "libx264"),
    ),
    Filmed(
        "a name that begins with a dash", "-v.mp4", "H.264", lambda path: encode(path, scene(25), "libx264")
    ),
    Filmed("a name in upper case", "DSC001.MP4", "H.264", lambda path: encode(path, scene(25), "libx264")),
    Filmed("a symbolic link inside the folder", "w.mp4", "H.264", _link),
    Filmed(
        "a still picture for a video",
        "x.mp4",
        "H.264",
        lambda path: encode(path, scene(25)[:1].repeat(205, axis=0), "libx264"),
    ),
    Filmed("half a download", "y.mp4", "H.264", _half),
)


def row(kind: Filmed, result: str) -> str:
    """The row of the table for a kind of clip."""
    return f"| {kind.what} | `{Path(kind.file).name}` | {kind.codec} | {result} |"


def main() -> None:
    """Try every kind and write the table."""
    with tempfile.TemporaryDirectory() as folder:
        rows = []
        for index, kind in enumerate(KINDS):
            (place := Path(folder, str(index))).mkdir()
            kind.write(place / kind.file)
            rows.append(row(kind, refusal(place, kind.file, place / "out") or "good"))
    DOCUMENT.write_text(_INTRODUCTION + "\n".join(rows) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
