"""The phases that all demonstrations share, approach, push and rest: when a moment of the rig comes in the simulation.

Both scripts follow minimum-jerk profiles within each phase, so between its ends equal parts of a phase are
equal progress. The hand of the rig waits a little between its phases, where the simulated arm does not.
"""

import numpy as np

LENGTH = 50  # frames of a simulated clip
SECONDS = 8.0  # that a clip of the rig lasts
# The hand leaves its rest, stands behind the object, starts to push, has pushed; the clip ends.
_KNOTS = (0.5, 2.3, 2.6, 6.8, SECONDS)
_STEPS = (0, 14, 14, 42, LENGTH - 1)


def steps_at(seconds: np.ndarray) -> np.ndarray:
    """The simulated expert's time steps, whole numbers, at ``seconds`` of the rig's clips; of any shape."""
    return np.interp(seconds, _KNOTS, _STEPS).round().astype(int)


def seconds_at(steps: np.ndarray) -> np.ndarray:
    """Seconds of the rig's clips at ``steps`` of the simulated expert, the middle of what it waits."""
    waited = 0.5 * (_KNOTS[1] + _KNOTS[2])
    return np.interp(steps, (*_STEPS[:1], *_STEPS[2:]), (_KNOTS[0], waited, *_KNOTS[3:]))
