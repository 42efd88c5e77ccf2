"""The command `anyview record`."""

import json
import sys
import time
from contextlib import ExitStack, redirect_stdout
from pathlib import Path
from typing import Annotated

import typer

from anyview import paths
from anyview.runtime.errors import AnyviewError

RECORDED = paths.raw("recorded")


def record(
    folder: Annotated[Path, typer.Argument(help="Where clips and manifest go.")] = RECORDED,
    camera: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=SOURCE", help="A camera: device number or video file; repeat for two views."
        ),
    ] = None,
    pair: Annotated[
        str | None, typer.Option(help="Id of this demonstration; without it, the next free one.")
    ] = None,
    kind: Annotated[
        str, typer.Option(help="standard, distractor, extreme_view or extreme_distractor.")
    ] = "standard",
    seconds: Annotated[float, typer.Option(min=1.0, max=600.0, help="Length of the cameras.")] = 8.0,
    delay: Annotated[float, typer.Option(min=0.0, help="Seconds to get ready.")] = 3.0,
    preview: Annotated[
        bool, typer.Option("--preview", help="Show the live views in a browser and wait for Enter.")
    ] = False,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Of the preview; 0 takes a free one.")] = 8808,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print JSON for a script; all else goes to standard error.")
    ] = False,
) -> None:
    """Film one demonstration with one or two webcams at once.

    Takes 10 frames a second, each stamped with its time. Before that, a still of each view is written as PNG.

    To use the clips, set real.source: recorded in params.yaml.
    """
    from anyview.cli import cameras

    named = [_parse_camera(text) for text in camera or ["left=0"]]
    pair = pair if pair is not None else cameras.free_pair(folder)
    cameras.check_place(folder, pair, kind, [name for name, _ in named])
    with redirect_stdout(sys.stderr if as_json else sys.stdout):
        clips = _film(named, folder, pair, kind, seconds, delay, port if preview else None)
        print(f"{', '.join(clip['file'] for clip in clips)}: added to {folder / 'manifest.csv'}")
        _compare_with_ingest(seconds)
    if as_json:
        print(json.dumps({"folder": str(folder), "pair": pair, "kind": kind, "clips": clips}))


def _film(
    named: list[tuple[str, str]],
    folder: Path,
    pair: str,
    kind: str,
    seconds: float,
    delay: float,
    port: int | None,
) -> list[dict[str, str]]:
    """Film with each camera of ``named``, (name, source); ``port`` is that of the preview, None without one.

    Returns name of the camera, clip and still for each, the files relative to ``folder``.
    """
    from anyview.cli import cameras
    from anyview.cli.preview import serving
    from anyview.runtime.progress import track
    from anyview.video.pictures import write_png

    folder.mkdir(parents=True, exist_ok=True)
    try:
        with ExitStack() as stack:
            views = []
            for name, source in named:
                views.append(cameras.Camera(name, source))
                stack.callback(views[-1].close)
            if port is not None:
                address = stack.enter_context(serving(views, port))
                print(f"live views at {address}; press Enter to film, Ctrl-C to leave", flush=True)
                sys.stdin.readline()
            stills = [folder / f"{pair}-{view.name}.png" for view in views]
            for view, still in zip(views, stills, strict=True):
                write_png(still, view.newest()[0])
                print(f"view of camera {view.name}: {still}", flush=True)
            _count_down(delay)
            with track(f"film {pair}", cameras.ticks(seconds)) as progress:
                files = cameras.film(views, folder, pair, kind, seconds, progress.advance)
    except KeyboardInterrupt:
        print("interrupted: no clip was kept", file=sys.stderr)
        raise
    return [
        {"camera": view.name, "file": file.name, "still": still.name}
        for view, file, still in zip(views, files, stills, strict=True)
    ]


def _compare_with_ingest(seconds: float) -> None:
    """Say so where stage `ingest` would refuse a clip of this length."""
    from anyview.config import load_params
    from anyview.ingest.normalize import LONGEST

    if not Path("params.yaml").is_file():
        return
    wanted = load_params().real.ingest
    least, most = wanted.frames / wanted.rate, LONGEST * wanted.frames / wanted.rate
    if not least <= seconds <= most:
        print(f"note: stage ingest takes clips of {least:g} to {most:g} s (real.ingest in params.yaml)")


def _parse_camera(text: str) -> tuple[str, str]:
    name, sign, source = text.partition("=")
    if not (name and sign and source):
        raise AnyviewError(f"--camera {text}: write NAME=SOURCE, such as left=0 or left=clip.mp4")
    return name, source


def _count_down(seconds: float) -> None:
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        print(f"filming in {left:.0f} s ...", flush=True)
        time.sleep(min(left, 1.0))
