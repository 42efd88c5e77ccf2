"""Clips as you would bring your own: demonstrations before a webcam that the study's surrogate does not hold.

    python examples/film_clips.py PAIRS FOLDER

Films PAIRS demonstrations by two cameras into FOLDER, with its manifest: data/raw/recorded is where the
pipeline looks for them. It is the surrogate's rig, with another seed. Try with these what few clips of your
own would give.
"""

import sys
import tempfile
from pathlib import Path

from anyview.config import load_params
from anyview.runtime.errors import AnyviewError, exit_code
from anyview.surrogate.film import film_set, plan

SEED = 7_000_000  # added to `base.seed`


def main(arguments: list[str]) -> None:
    if len(arguments) != 2 or not arguments[0].isdecimal() or int(arguments[0]) < 2:
        raise AnyviewError("usage: python examples/film_clips.py PAIRS FOLDER; PAIRS is 2 or more")
    folder = Path(arguments[1])
    if folder.exists():
        raise AnyviewError(f"{folder}: is there already; name another folder")
    params = load_params()
    with tempfile.TemporaryDirectory() as scratch:
        demonstrations = plan(int(arguments[0]), 0, 0)
        film_set(folder, demonstrations, params.real.film.width, params.base.seed + SEED, Path(scratch))


if __name__ == "__main__":
    sys.exit(exit_code(lambda: main(sys.argv[1:])))
