"""The command `anyview clips`."""

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from anyview import paths
from anyview.runtime.errors import AnyviewError

RAW = paths.raw("recorded")


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
    from_lerobot: Annotated[
        Path | None,
        typer.Option(
            "--from-lerobot", metavar="FOLDER", help="List the episodes of a LeRobotDataset in the manifest."
        ),
    ] = None,
    camera: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY", help="Its camera, observation.images.top; repeat for two views."),
    ] = None,
    raw: Annotated[Path, typer.Option("--raw", metavar="FOLDER", help="The folder of raw clips.")] = RAW,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for a script.")] = False,
) -> None:
    """List the clips that there are, by kind, split and source, and the refused with the reason."""
    from anyview.cli.overview import ingested_source, lines, survey
    from anyview.config import load_params

    if sheet is not None and sheet.suffix.lower() != ".png":
        raise AnyviewError(f"{sheet}: a contact sheet is a .png file")
    if sheet is not None and (propose or from_lerobot is not None):
        raise AnyviewError("--sheet shows ingested clips: not with --propose or --from-lerobot")
    if propose and from_lerobot is not None:
        raise AnyviewError("--propose and --from-lerobot both write a manifest: one of them")
    if camera and from_lerobot is None:
        raise AnyviewError("--camera names those of a LeRobotDataset: only with --from-lerobot")
    if propose:
        _propose(raw, as_json)
        return
    if from_lerobot is not None:
        _list_episodes(raw, from_lerobot, camera or [], as_json)
        return
    params = load_params()
    found = survey(ingested_source() or params.real.source, params.split)
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


def _list_episodes(folder: Path, dataset: Path, cameras: list[str], as_json: bool) -> None:
    from anyview.cli.episodes import list_episodes

    rows = list_episodes(folder, dataset, cameras)
    if as_json:
        print(
            json.dumps({"manifest": str(folder / "manifest.csv"), "clips": rows.to_dict("records")}, indent=2)
        )
        return
    print(f"{len(rows)} clips of {rows['pair'].nunique()} episodes: added to {folder / 'manifest.csv'}")


def _write_sheet(path: Path) -> None:
    from anyview.video.pictures import contact_sheet, write_png
    from anyview.video.sets import open_frames

    store = open_frames(paths.clip_set(paths.REAL))
    labels = [f"{row.clip} {row.kind}" for row in store.manifest.itertuples()]
    write_png(path, contact_sheet(list(store.frames), labels))
