"""Stage `film`: the surrogate webcam clips, as a camera would leave them."""

import shutil

from anyview import paths
from anyview.config import load_params
from anyview.runtime.errors import refuse_arguments, run_stage
from anyview.runtime.scratch import checkpoint_folder
from anyview.surrogate.film import film_set, plan


def main(arguments: list[str]) -> None:
    """Film every demonstration; a killed stage continues after the last finished one."""
    refuse_arguments(arguments, "python stages/film.py")
    params = load_params()
    wanted = params.real.film
    scratch = checkpoint_folder(["film", params.base.seed, wanted.width])
    demonstrations = plan(wanted.pairs, wanted.singles, wanted.extreme_pairs)
    film_set(paths.raw("surrogate"), demonstrations, wanted.width, params.base.seed, scratch)
    shutil.rmtree(scratch)


if __name__ == "__main__":
    run_stage(main)
