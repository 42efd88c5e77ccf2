"""The thesis's published numbers (Cranfield MSc thesis, 2021, figures 13 to 20), kept beside ours.

Losses are sums over a batch of 100; that scale is inferred from their size, the thesis does not state it.
"""

import math
from dataclasses import dataclass

RUNS = 15
"""Runs behind every success rate of figures 19 and 20."""


@dataclass(frozen=True)
class LossCurve:
    """What the text says about one loss over training: values, and the iterations that they stand at."""

    start: float | None
    at_500: float
    minimum: float
    minimum_iteration: int

    def points(self) -> list[tuple[int, float]]:
        """The (iteration, loss) points that are stated."""
        first = [] if self.start is None else [(0, self.start)]
        return [*first, (500, self.at_500), (self.minimum_iteration, self.minimum)]


@dataclass(frozen=True)
class PublishedRun:
    """One of the two trainings on real clips."""

    total: LossCurve
    validation: LossCurve
    iterations: int
    hours: float


ADAM = PublishedRun(LossCurve(47_564, 9_862, 3_214, 10_567), LossCurve(None, 9_624, 2_615, 11_242), 11_750, 8)
"""Figure 13: real clips, Adam, learning rate 0.001, on a GTX 970."""

ADADELTA = PublishedRun(
    LossCurve(41_323, 26_469, 13_621, 6_102), LossCurve(38_212, 27_441, 12_232, 3_903), 6_320, 6
)
"""Figure 14: the same with AdaDelta."""

FRAMES = 80
FEATURE_WEIGHTS = ((0, 4, 0.016), (5, 29, 0.010), (30, 40, 0.025), (41, 48, 0.0), (60, 62, 0.008))
"""Figure 15 as (first frame, last frame, weight). Not every frame is stated; the sum is not 1: a shape."""

VALIDATION_CLIPS = 21
VALIDATION_LOSS = 4_232
EXTREME_LOSS = 11_562

VALUES = {
    ("sim.diverse", "demos"): 4_000,
    ("real", "train"): 122,
    ("real", "validation"): VALIDATION_CLIPS,
    ("real", "extreme"): 10,
    ("real-adam", "iterations"): ADAM.iterations,
    ("real-adam", "validation.example_loss"): 3_415,  # figure 16
    ("real-adam", "validation.loss"): VALIDATION_LOSS,
    ("real-adam", "extreme.loss"): EXTREME_LOSS,  # figure 17
    ("real-adam", "extreme.ratio"): EXTREME_LOSS / VALIDATION_LOSS,
    ("real-adadelta", "iterations"): ADADELTA.iterations,
    ("sim", "validation.loss"): 2_302,  # figure 18, in another scene
}
"""What stands beside our value of a cell's metric, for all but the success rates."""

LIU_VALIDATION_LOSS = round(VALIDATION_LOSS / (1 - 0.21))
"""Figure 16: the thesis's loss is 21% under that of Liu et al. (2018)."""

SUCCESSES = {
    "ours": 12,
    "liu": 11,
    "tpil": 0,
    "gail": 0,
    "oracle": 13,
    "no-translation": 7,
    "no-reconstruction": 6,
    "no-alignment": 11,
    "no-reconstruction-alignment": 6,
    "no-feature-reward": 7,
    "no-image-reward": 9,
}
"""Figures 19 and 20, as successes of ``RUNS``: the rates are stated as percentages (12 of 15 as 80%)."""

BATCH = 100
POLICY_ITERATIONS = 250
SEED = 42
"""Scale: frames in a batch of the translator's training, iterations of a policy's, seed."""


def feature_weight_scale() -> float:
    """What brings figure 15's stated weights to a sum of 1."""
    return 1 / sum(weight * (last + 1 - first) for first, last, weight in FEATURE_WEIGHTS)


def feature_weight_shape() -> list[float]:
    """Figure 15 over its 80 frames, scaled so that the stated ones sum to 1; the others are NaN."""
    weights = [math.nan] * FRAMES
    for first, last, weight in FEATURE_WEIGHTS:
        weights[first : last + 1] = [weight * feature_weight_scale()] * (last + 1 - first)
    return weights
