"""The commands `anyview record` and `anyview clips`."""

import json
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from anyview.runtime.errors import AnyviewError

RAW = Path("data/real/raw")


def record(
    folder: Annotated[Path, typer.Argument(help="Where clips and manifest go.")] = RAW,
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
    seconds: Annotated[float, typer.Option(min=1.0, max=600.0, help="Length of the recording.")] = 8.0,
    delay: Annotated[float, typer.Option(min=0.0, help="Seconds to get ready.")] = 3.0,
    preview: Annotated[
        bool, typer.Option("--preview", help="Show the live views in a browser and wait for Enter.")
    ] = False,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Of the preview; 0 takes a free one.")] = 8808,
) -> None:
    """Film one demonstration with one or two webcams at once.

    Takes 10 frames a second, each stamped with its time. Before that, a still of each view is written as PNG.

    To use the clips, set real.source: recorded in params.yaml.
    """
    from anyview.cli import recording
    from anyview.cli.preview import serving
    from anyview.config import load_params
    from anyview.ingest.normalize import LONGEST
    from anyview.runtime.progress import track
    from anyview.video.pictures import write_png

    named = [_parse_camera(text) for text in camera or ["left=0"]]
    pair = pair if pair is not None else recording.free_pair(folder)
    recording.check_place(folder, pair, kind, [name for name, _ in named])
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with ExitStack() as stack:
            views = []
            for name, source in named:
                views.append(recording.Camera(name, source))
                stack.callback(views[-1].close)
            if preview:
                address = stack.enter_context(serving(views, port))
                print(f"live views at {address}; press Enter to film, Ctrl-C to leave", flush=True)
                sys.stdin.readline()
            for view in views:
                still = folder / f"{pair}-{view.name}.png"
                write_png(still, view.newest()[0])
                print(f"view of camera {view.name}: {still}", flush=True)
            _count_down(delay)
            with track(f"film {pair}", recording.ticks(seconds)) as progress:
                paths = recording.film(views, folder, pair, kind, seconds, progress.advance)
    except KeyboardInterrupt:
        print("interrupted: no clip was kept", file=sys.stderr)
        raise
    print(f"{', '.join(path.name for path in paths)}: added to {folder / 'manifest.csv'}")
    if Path("params.yaml").is_file():
        wanted = load_params().real.ingest
        least, most = wanted.frames / wanted.rate, LONGEST * wanted.frames / wanted.rate
        if not least <= seconds <= most:
            print(f"note: stage ingest takes clips of {least:g} to {most:g} s (real.ingest in params.yaml)")


def clips(
    sheet: Annotated[
        Path | None, typer.Option("--sheet", metavar="PNG", help="Also write a contact sheet of the clips.")
    ] = None,
    propose: Annotated[
        bool,
        typer.Option(
            "--propose", help="Propose a manifest for the raw clips, with start and end by their motion."
        ),
    ] = False,
    raw: Annotated[Path, typer.Option("--raw", metavar="FOLDER", help="The raw clips to propose for.")] = RAW,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for a script.")] = False,
) -> None:
    """List the clips that there are, by kind, split and source, and the refused with the reason."""
    from anyview.cli.overview import ingested_source, lines, survey
    from anyview.config import load_params

    if sheet is not None and sheet.suffix.lower() != ".png":
        raise AnyviewError(f"{sheet}: a contact sheet is a .png file")
    if propose:
        _propose(raw, as_json)
        return
    found = survey(ingested_source() or load_params().real.source)
    print(json.dumps(found, indent=2) if as_json else "\n".join(lines(found)))
    if sheet is not None:
        _write_sheet(sheet)
        print(f"contact sheet: {sheet}", file=sys.stderr if as_json else sys.stdout)


def _propose(folder: Path, as_json: bool) -> None:
    from anyview.cli.proposal import propose
    from anyview.config import load_params

    table, reasons = propose(folder, load_params().real.ingest)
    rows = [row | {"reason": reasons.get(row["file"], "")} for row in table.to_dict("records")]
    if as_json:
        print(json.dumps({"manifest": str(folder / "manifest.proposed.csv"), "clips": rows}, indent=2))
        return
    for row in rows:
        print(f"{row['file']}: {row['reason'] or '{start} to {end} s'.format(**row)}")
    print(f"check {folder / 'manifest.proposed.csv'} by the pictures in {folder / 'manifest.proposed.png'};")
    print("then rename it to manifest.csv")


def _write_sheet(path: Path) -> None:
    from anyview.video.pictures import contact_sheet, write_png
    from anyview.video.sets import open_frames

    store = open_frames(Path("data/real/clips"))
    labels = [f"{row.clip} {row.kind}" for row in store.manifest.itertuples()]
    write_png(path, contact_sheet(list(store.frames), labels))


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
