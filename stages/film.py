"""Stage `film`: the surrogate webcam clips, as a camera would leave them."""

import shutil

import pandas as pd

from anyview import paths
from anyview.config import load_params
from anyview.runtime.errors import refuse_arguments, run_stage
from anyview.runtime.outputs import whole_folder, write_atomically
from anyview.runtime.progress import track
from anyview.runtime.scratch import checkpoint_folder
from anyview.runtime.workers import run_tasks
from anyview.surrogate.film import film, plan
from anyview.video.manifests import times_file


def main(arguments: list[str]) -> None:
    """Film every demonstration; a killed stage continues after the last finished one."""
    refuse_arguments(arguments, "python stages/film.py")
    params = load_params()
    wanted = params.real.film
    scratch = checkpoint_folder(["film", params.base.seed, wanted.width])
    demonstrations = plan(wanted.pairs, wanted.singles, wanted.extreme_pairs)
    tasks = [(scratch, demonstration, wanted.width, params.base.seed) for demonstration in demonstrations]
    rows: list[dict[str, str]] = []
    with track("film", len(tasks)) as progress:
        for filmed in run_tasks(film, tasks):
            rows += filmed
            progress.advance()
    with whole_folder(paths.raw("surrogate")) as output:
        for row in rows:
            for name in (row["file"], times_file(row["file"])):
                shutil.copyfile(scratch / name, output / name)
        write_atomically(output / "manifest.csv", pd.DataFrame(rows).to_csv(index=False))
    shutil.rmtree(scratch)


if __name__ == "__main__":
    run_stage(main)
