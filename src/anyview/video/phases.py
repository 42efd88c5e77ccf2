"""The phases of a demonstration, approach, push and rest: how the rig's clips and simulated ones keep step.

Both scripts follow minimum-jerk profiles within a phase, so that equal parts of it are equal progress. The
hand of the rig waits a little between its phases, where the simulated arm does not.
"""

import numpy as np

LENGTH = 50  # frames of a simulated clip
SECONDS = 8.0  # that a clip of the rig lasts
# The hand leaves its rest, stands behind the object, starts to push, has pushed; the clip ends.
_KNOTS = (0.5, 2.3, 2.6, 6.8, SECONDS)
_STEPS = (0, 14, 14, 42, LENGTH - 1)


def steps_at(seconds: np.ndarray) -> np.ndarray:
    """The simulated expert's time steps, whole numbers, at ``seconds`` of a clip of the rig; of any shape."""
    return np.interp(seconds, _KNOTS, _STEPS).round().astype(int)


def seconds_at(steps: np.ndarray) -> np.ndarray:
    """Seconds of a clip of the rig at ``steps`` of the simulated expert, a wait taken at its end."""
    return np.interp(steps, _STEPS, _KNOTS)


def seconds_of(length: int) -> np.ndarray:
    """When each of the ``length`` frames of a clip of the whole demonstration was taken."""
    return np.arange(length) * (SECONDS / length)


def frames_in_step(seconds: np.ndarray) -> np.ndarray:
    """Which frames of a clip of the rig, taken at ``seconds`` (T,), show each simulated step best: (50,)."""
    return np.abs(seconds - seconds_at(np.arange(LENGTH))[:, None]).argmin(axis=1)
