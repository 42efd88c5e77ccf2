"""The thesis's published numbers (Cranfield MSc thesis, 2021, figures 13 to 20), kept beside ours.

Losses are sums over a batch of 100; that scale is inferred from their size, the thesis does not state it.
"""

import math
from dataclasses import dataclass

RUNS = 15
"""Runs behind every success rate of figures 19 and 20."""


@dataclass(frozen=True)
class LossCurve:
    """What the text says about one loss over training: values, and the iterations they stand at."""

    start: float | None
    at_500: float
    minimum: float
    minimum_iteration: int

    def points(self) -> list[tuple[int, float]]:
        """The (iteration, loss) points that are stated."""
        first = [] if self.start is None else [(0, self.start)]
        return [*first, (500, self.at_500), (self.minimum_iteration, self.minimum)]


@dataclass(frozen=True)
class TrainingRun:
    """One of the two trainings on real clips."""

    total: LossCurve
    validation: LossCurve
    iterations: int
    hours: float


ADAM = TrainingRun(LossCurve(47_564, 9_862, 3_214, 10_567), LossCurve(None, 9_624, 2_615, 11_242), 11_750, 8)
"""Figure 13: real clips, Adam, learning rate 0.001, on a GTX 970."""

ADADELTA = TrainingRun(
    LossCurve(41_323, 26_469, 13_621, 6_102), LossCurve(38_212, 27_441, 12_232, 3_903), 6_320, 6
)
"""Figure 14: the same with AdaDelta."""

FRAMES = 80
FEATURE_WEIGHTS = ((0, 4, 0.016), (5, 29, 0.010), (30, 40, 0.025), (41, 48, 0.0), (60, 62, 0.008))
"""Figure 15 as (first frame, last frame, weight). Not every frame is stated; the sum is not 1: a shape."""

STRIP_EXAMPLE_LOSS = 3_415
VALIDATION_LOSS = 4_232
LIU_VALIDATION_LOSS = round(VALIDATION_LOSS / (1 - 0.21))  # the text: 21% under Liu et al. (2018)
VALIDATION_CLIPS = 21
"""Figure 16: one example, and the mean over the validation clips."""

EXTREME_LOSS = 11_562
EXTREME_CLIPS = 10
EXTREME_RATIO = EXTREME_LOSS / VALIDATION_LOSS
"""Figure 17: the extreme distractor clips, and how many times the validation loss that is."""

SIMULATION_LOSS = 2_302
"""Figure 18: mean loss of the simulated validation clips."""

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

DEMONSTRATIONS = 4_000
TRAIN_CLIPS = 122
"""Data: simulated demonstrations, and real training clips."""

BATCH = 100
POLICY_ITERATIONS = 250
"""Scale: frames in a batch of the translator's training, and iterations of a policy's."""


def feature_weight_scale() -> float:
    """What brings figure 15's stated weights to a sum of 1."""
    return 1 / sum(weight * (last + 1 - first) for first, last, weight in FEATURE_WEIGHTS)


def feature_weight_shape() -> list[float]:
    """Figure 15 over its 80 frames, scaled so that the stated ones sum to 1; the others are NaN."""
    weights = [math.nan] * FRAMES
    for first, last, weight in FEATURE_WEIGHTS:
        weights[first : last + 1] = [weight * feature_weight_scale()] * (last + 1 - first)
    return weights
