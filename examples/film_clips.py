"""Clips as you would bring your own: demonstrations before a webcam that the study's surrogate does not hold.

    python examples/film_clips.py PAIRS FOLDER

Films PAIRS demonstrations by two cameras into FOLDER, with its manifest: data/raw/recorded is where the
pipeline looks for them. It is the surrogate's rig, with another seed. Try with these what few clips of your
own would give.
"""

import shutil
import sys
import tempfile
from pathlib import Path

import pandas as pd

from anyview.config import load_params
from anyview.runtime.errors import AnyviewError, exit_code
from anyview.runtime.outputs import whole_folder, write_atomically
from anyview.runtime.progress import track
from anyview.runtime.workers import run_tasks
from anyview.surrogate.film import film, plan
from anyview.video.manifests import times_file

SEED = 7_000_000  # added to `base.seed`


def main(arguments: list[str]) -> None:
    if len(arguments) != 2 or not arguments[0].isdecimal() or int(arguments[0]) < 2:
        raise AnyviewError("usage: python examples/film_clips.py PAIRS FOLDER; PAIRS is 2 or more")
    folder = Path(arguments[1])
    if folder.exists():
        raise AnyviewError(f"{folder}: is there already; name another folder")
    params = load_params()
    seed, width = params.base.seed + SEED, params.real.film.width
    rows: list[dict[str, str]] = []
    with tempfile.TemporaryDirectory() as scratch, whole_folder(folder) as output:
        tasks = [(Path(scratch), shot, width, seed) for shot in plan(int(arguments[0]), 0, 0)]
        with track("film", len(tasks)) as progress:
            for filmed in run_tasks(film, tasks):
                rows += filmed
                progress.advance()
        for row in rows:
            for name in (row["file"], times_file(row["file"])):
                shutil.copyfile(Path(scratch) / name, output / name)
        write_atomically(output / "manifest.csv", pd.DataFrame(rows).to_csv(index=False))


if __name__ == "__main__":
    sys.exit(exit_code(lambda: main(sys.argv[1:])))
