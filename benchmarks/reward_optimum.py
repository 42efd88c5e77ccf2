"""Where the reward puts the object: the optimum of its terms at a demonstration's end, in unseen contexts.

    python benchmarks/reward_optimum.py [--model data/models/sim] [--contexts 24]

The arm stands where the expert's ends, and the object is moved around the goal on a grid of 1 cm. For each
term, in units of what standing still costs on average: its cost with the object in place, what 2 cm and 4 cm
away cost beyond that, and how far from the goal the cheapest place lies. Needs the stages `simulate`, `split`
and the model's `train`. The contexts are the stream "tuning", never the evaluation's.
"""

import argparse
from pathlib import Path

import numpy as np
import torch

from anyview.config import load_params
from anyview.evaluation.demonstrations import imitated_demonstrations
from anyview.pusher.contexts import sample_contexts
from anyview.pusher.expert import roll_out
from anyview.pusher.render import renderer
from anyview.rewards.demonstration import translate_demonstrations
from anyview.seeds import stream
from anyview.translator.weights import load_translator
from anyview.video.pixels import to_input

REACH = 6  # centimetres each way


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--model", type=Path, default=Path("data/models/sim"))
    parser.add_argument("--contexts", type=int, default=24)
    options = parser.parse_args()

    if not options.model.is_dir():
        print(f"skipped: {options.model} does not exist; run dvc repro first")
        return
    params = load_params()
    weights = params.imitation.cells["ours"].weights
    phi = weights.image / weights.feature
    contexts, _ = sample_contexts(stream(params.base.seed, "tuning"), options.contexts)
    positions, _ = roll_out(contexts)
    camera = renderer("push", params.sim.image_size)
    model = load_translator(options.model)
    demonstrations = imitated_demonstrations(params).frames
    first = np.stack([camera.render_clip(c, p[:1])[0] for c, p in zip(contexts, positions, strict=True)])
    features, images = translate_demonstrations(model, demonstrations, first)

    steps = np.arange(-REACH, REACH + 1)
    offsets = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    away = np.linalg.norm(offsets, axis=-1)
    weights = params.imitation.cells["ours"].weights
    phi = weights.image / weights.feature
    costs: dict[str, list[np.ndarray]] = {
        "L_f": [],
        "L_i": [],
        f"L_f + {phi:g} L_i": [],
    }
    for run, context in enumerate(contexts):
        moved = np.repeat(positions[run, -1:], len(offsets), axis=0)
        moved[:, 3:] += offsets / 100
        seen = to_input(torch.from_numpy(camera.render_clip(context, moved)))
        still = to_input(torch.from_numpy(first[run : run + 1]))
        with torch.inference_mode():
            feature = _squares(model.expert_features(seen), features[run, -1])
            feature /= _squares(model.expert_features(still), features[run]).mean()
        image = _squares(seen, images[run, -1]) / _squares(still, images[run]).mean()
        for name, cost in zip(costs, (feature, image, (feature + phi * image) / (1 + phi)), strict=True):
            costs[name].append(cost.numpy())

    print(
        f"{'term':14} {'in place':>9} {'+ at 2 cm':>10} {'+ at 4 cm':>10} {'optimum, cm':>12} "
        f"{'within 2 cm':>12}"
    )
    for name, rows in costs.items():
        table = np.stack(rows)
        place = table[:, away == 0].mean(1)
        rise = [(table[:, np.isclose(away, distance)].mean(1) - place).mean() for distance in (2, 4)]
        best = away[table.argmin(1)]
        print(
            f"{name:14} {place.mean():9.2f} {rise[0]:10.3f} {rise[1]:10.3f} "
            f"{np.median(best):12.1f} {int((best <= 2).sum()):8d}/{len(best)}"
        )


def _squares(values: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
    return ((values - target) ** 2).flatten(1).sum(1)


if __name__ == "__main__":
    main()
