"""Does it matter from where a real clip was filmed? Where the object is put, by the angle between cameras.

    python benchmarks/viewpoints.py [MODEL] [--pairs 60]     (default: data/models/real-pretrained)

The surrogate's rig films PAIRS demonstrations that no part of the study holds, by two cameras each; they are
ingested as the pipeline does, and each clip is translated to the other camera's view. Intervals draw both
clips of a demonstration together. Clips stay in benchmarks/out/viewpoints.
"""

import argparse
import os
import subprocess
import sys
from pathlib import Path

import pandas as pd
import torch

from anyview import paths
from anyview.analysis.estimates import Estimator
from anyview.analysis.study import read_azimuths
from anyview.analysis.viewpoints import angle_classes
from anyview.assessment.evaluation import evaluate_clip
from anyview.report.formatting import percent_spread
from anyview.runtime.progress import track
from anyview.translator.weights import load_translator
from anyview.video.datasets import clip_pairs, open_dataset

ROOT = Path(__file__).parents[1]
METRICS = ("placed", "placed_on_way", "copy_placed")


def prepare(folder: Path, pairs: int) -> None:
    """Film and ingest into ``folder``, unless that was done; all clips but the first two are held out."""
    folder.mkdir(parents=True, exist_ok=True)
    params = (ROOT / "params.yaml").read_text(encoding="utf-8")
    (folder / "params.yaml").write_text(
        params.replace("source: surrogate", "source: recorded"), encoding="utf-8"
    )
    if not (folder / paths.raw("recorded")).exists():
        film = [sys.executable, ROOT / "examples/film_clips.py", str(pairs), paths.raw("recorded")]
        subprocess.run(film, cwd=folder, check=True)
    if not (folder / paths.clip_set(paths.REAL)).exists():
        subprocess.run([sys.executable, ROOT / "stages/ingest.py"], cwd=folder, check=True)
    manifest = pd.read_csv(folder / paths.clip_set(paths.REAL) / "manifest.csv")
    split = folder / paths.split_table(paths.REAL)
    split.parent.mkdir(parents=True, exist_ok=True)
    # A data set has clips to train on: these two here.
    held_out = manifest["pair"] != manifest["pair"].iloc[0]
    splits = held_out.map({True: "validation", False: "train"})
    manifest[["clip", "pair"]].assign(split=splits).to_csv(split, index=False)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("model", type=Path, nargs="?", default=ROOT / "data/models/real-pretrained")
    parser.add_argument("--pairs", type=int, default=60)
    options = parser.parse_args()
    if not options.model.is_dir():
        print(f"skipped: {options.model} does not exist; run dvc repro first")
        return
    model = load_translator(options.model.absolute())
    folder = ROOT / f"benchmarks/out/viewpoints/{options.pairs}"
    prepare(folder, options.pairs)
    os.chdir(folder)

    dataset = open_dataset(paths.REAL)
    rows = []
    pairs = clip_pairs(dataset, "validation")
    with track("translate", len(pairs)) as progress:
        for source, target in pairs:
            rows.append(evaluate_clip(model, dataset, source, target).row)
            progress.advance()
    clips, estimator = pd.DataFrame(rows), Estimator(0)
    clips.to_csv(f"{options.model.name}.csv", index=False, float_format="%.6g")
    azimuths = read_azimuths(paths.clip_set(paths.REAL), paths.raw("recorded"))
    print(f"{options.model}, {len(clips)} clips of {clips['pair'].nunique()} demonstrations")
    print("angle | clips | " + " | ".join(METRICS))
    for name, members in [*angle_classes(clips, azimuths), ("all", clips)]:
        found = [
            estimator.mean(f"{name}/{metric}", known[metric].to_numpy(float), known["pair"].to_numpy())
            for metric in METRICS
            for known in [members[members[metric].notna()]]
        ]
        print(f"{name} | {len(members)} | " + " | ".join(map(percent_spread, found)))


if __name__ == "__main__":
    torch.set_num_threads(1)
    main()
