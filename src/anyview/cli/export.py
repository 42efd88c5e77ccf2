"""The command `anyview export`."""

import json
import sys
from contextlib import redirect_stdout
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from anyview import paths


class Format(StrEnum):
    """What other programs read."""

    LEROBOT = "lerobot"


def export(
    clips: Annotated[str, typer.Argument(metavar="SET", help="A set of clips: diverse, real, or a folder.")],
    output: Annotated[Path, typer.Argument(metavar="OUT", help="The folder to make.")],
    format_: Annotated[
        Format, typer.Option("--format", help="lerobot: a LeRobotDataset v3.0.")
    ] = Format.LEROBOT,
    camera: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="A camera of the set; without it, all of them.")
    ] = None,
    task: Annotated[str, typer.Option(help="What the clips show, in words.")] = "the demonstrated task",
    as_json: Annotated[
        bool, typer.Option("--json", help="Print JSON for a script; all else goes to standard error.")
    ] = False,
) -> None:
    """Write a set of clips in a format that other programs read: videos alone, without the expert's actions.

    A demonstration is an episode, with the views of all cameras. One that a camera did not see is left out.
    """
    from anyview.cli.episodes import export_set

    folder = Path(clips) if Path(clips).is_dir() else paths.clip_set(clips)
    with redirect_stdout(sys.stderr if as_json else sys.stdout):
        written, left_out = export_set(folder, output, camera or [], task)
    if as_json:
        print(json.dumps({"output": str(output), "episodes": written, "left_out": left_out}))
        return
    missing = f"; {left_out} left out that a camera did not see (see --camera)" if left_out else ""
    print(f"{output}: {written} episodes{missing}")
