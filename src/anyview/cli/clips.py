"""The command `anyview clips`."""

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from anyview import paths
from anyview.runtime.errors import AnyviewError


def clips(
    sheet: Annotated[
        Path | None, typer.Option("--sheet", metavar="PNG", help="Also write a contact sheet of the clips.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for a script.")] = False,
) -> None:
    """List the clips that there are, by kind, split and source, and the refused with the reason."""
    from anyview.cli.overview import ingested_source, lines, survey
    from anyview.config import load_params

    if sheet is not None and sheet.suffix.lower() != ".png":
        raise AnyviewError(f"{sheet}: a contact sheet is a .png file")
    params = load_params()
    found = survey(ingested_source() or params.real.source, params.split)
    print(json.dumps(found, indent=2) if as_json else "\n".join(lines(found)))
    if sheet is not None:
        _write_sheet(sheet)
        print(f"contact sheet: {sheet}", file=sys.stderr if as_json else sys.stdout)


def _write_sheet(path: Path) -> None:
    from anyview.video.pictures import contact_sheet, write_png
    from anyview.video.sets import open_frames

    store = open_frames(paths.clip_set(paths.REAL))
    labels = [f"{row.clip} {row.kind}" for row in store.manifest.itertuples()]
    write_png(path, contact_sheet(list(store.frames), labels))
