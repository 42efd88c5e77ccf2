"""Stage `split`: assign the clips of one set to train, validation and extreme, by pair."""

from pathlib import Path

from anyview.config import load_params
from anyview.runtime.errors import AnyviewError, run_stage
from anyview.runtime.outputs import write_atomically
from anyview.video.manifests import read_table
from anyview.video.splits import split_pairs

SETS = {
    "sim-diverse": Path("data/sim/diverse/manifest.csv"),
    "sim-narrow": Path("data/sim/narrow/manifest.csv"),
    "real": Path("data/real/clips/manifest.csv"),
}


def main(arguments: list[str]) -> None:
    if len(arguments) != 1 or arguments[0] not in SETS:
        raise AnyviewError(f"usage: python stages/split.py {'|'.join(SETS)}")
    name = arguments[0]
    params = load_params()
    if name == "real":
        clips = read_table(SETS[name], ["clip", "pair", "kind"], unique="clip")
        train, validation = params.split.real.train, params.split.real.validation
    else:  # a simulated demonstration is seen from one viewpoint: each is a pair of its own
        clips = read_table(SETS[name], ["clip"], unique="clip")
        clips = clips.assign(pair=clips["clip"], kind="standard")
        validation = params.split.sim.validation
        if validation >= len(clips):
            raise AnyviewError(
                f"params.yaml: split.sim.validation: {validation:.0f}, but {name} has {len(clips)} clips"
            )
        train = len(clips) - validation if validation >= 1 else 1.0 - validation
    table = split_pairs(clips, params.base.seed, train, validation)
    write_atomically(Path("data/splits") / f"{name}.csv", table.to_csv(index=False))
    counts = ", ".join(f"{count} {split}" for split, count in table["split"].value_counts().items())
    left_out = len(clips) - len(table)
    print(f"{name}: {counts}" + (f"; {left_out} left out: raise split.real" if left_out else ""))


if __name__ == "__main__":
    run_stage(main)
