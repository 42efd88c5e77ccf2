"""Stages that are long enough to be killed half-way: how each is run so that it lasts some seconds."""

import hashlib
from pathlib import Path
from typing import NamedTuple

from ruamel.yaml import YAML


class LongStage(NamedTuple):
    """A stage's command, the folder that it makes, and params that make another one than `smoke` does."""

    command: list[str]
    output: str
    params: dict[str, object]


LONG_STAGES = {
    "simulate": LongStage(
        ["stages/simulate.py", "diverse"],
        "data/clips/diverse",
        {"simulate.sets.diverse.demos": 120, "simulate.shard": 6},
    ),
    "film": LongStage(
        ["stages/film.py"], "data/raw/surrogate", {"real.film.pairs": 4, "real.film.extreme_pairs": 1}
    ),
    "render": LongStage(["stages/render.py"], "data/clips/rendered", {"real.render.demonstrations": 60}),
    "ingest": LongStage(["stages/ingest.py"], "data/clips/real", {"real.ingest.frames": 60}),
    "train": LongStage(
        ["stages/train.py", "sim"],
        "data/models/sim",
        {"translators.sim.iterations": 120, "training.validation_every": 10},
    ),
    "imitate": LongStage(
        ["stages/imitate.py", "ours"],
        "data/policies/ours",
        {"imitation.iterations": 10, "imitation.runs": 9},
    ),
}


def change(folder: Path, params: dict[str, object]) -> None:
    """Set dotted keys in the params.yaml of a study in ``folder``."""
    path = folder / "params.yaml"
    yaml = YAML()
    tree = yaml.load(path.read_text())
    for key, value in params.items():
        *parents, last = key.split(".")
        branch = tree
        for parent in parents:
            branch = branch[parent]
        branch[last] = value
    with path.open("w") as file:
        yaml.dump(tree, file)


def digests(folder: Path) -> dict[str, str]:
    """SHA-256 of every file below ``folder`` by its path there."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
