"""Stage `split`: assign the clips of one set to train, validation and extreme, by pair.

Usage: python stages/split.py SET
"""

from anyview import paths
from anyview.config import load_params
from anyview.runtime.errors import AnyviewError, choose, run_stage
from anyview.runtime.outputs import write_atomically
from anyview.video.manifests import read_table
from anyview.video.splits import split_pairs


def main(arguments: list[str]) -> None:
    """Split one set."""
    params = load_params()
    name = choose(arguments, params.splits, "python stages/split.py SET")
    manifest = paths.clip_set(name) / "manifest.csv"
    train, validation = params.splits[name].train, params.splits[name].validation
    if name == paths.REAL:
        clips = read_table(manifest, ["clip", "pair", "kind"], unique="clip")
    elif name == paths.RENDERED:
        clips = read_table(manifest, ["clip", "pair"], unique="clip").assign(kind="standard")
    else:  # a simulated demonstration is seen from one viewpoint: each is a pair of its own
        clips = read_table(manifest, ["clip"], unique="clip")
        clips = clips.assign(pair=clips["clip"], kind="standard")
    if train is None:
        if validation >= len(clips):
            raise AnyviewError(
                f"params.yaml: split.{name}.validation: {validation:.0f}, but {name} has {len(clips)} clips"
            )
        train = len(clips) - validation if validation >= 1 else 1.0 - validation
    table = split_pairs(clips, params.base.seed, train, validation)
    write_atomically(paths.split_table(name), table.to_csv(index=False))
    counts = ", ".join(f"{count} {split}" for split, count in table["split"].value_counts().items())
    left_out = len(clips) - len(table)
    print(f"{name}: {counts}" + (f"; {left_out} left out: raise split.{name}" if left_out else ""))


if __name__ == "__main__":
    run_stage(main)
