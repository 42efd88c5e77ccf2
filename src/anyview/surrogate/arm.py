"""The operator's arm: a shoulder that leans over the table and an elbow by inverse kinematics."""

import math

import numpy as np


def lean(shoulder: np.ndarray, wrist: np.ndarray, reach: float) -> np.ndarray:
    """Where the shoulder (3,) goes: the operator leans over if the wrist (3,) is out of an arm's reach."""
    distance = math.dist(shoulder, wrist)
    excess = max(distance - 0.97 * reach, 0.0)
    return shoulder + excess * (wrist - shoulder) / distance


def bend(
    shoulder: np.ndarray, wrist: np.ndarray, upper_arm: float, forearm: float, outwards: np.ndarray
) -> np.ndarray:
    """Where the elbow (3,) is: two-link inverse kinematics, hanging ``outwards`` (3,)."""
    gap = wrist - shoulder
    reach = math.dist(shoulder, wrist)
    along = (reach**2 + upper_arm**2 - forearm**2) / (2 * reach)
    aside = outwards - (outwards * gap).sum() * gap / reach**2
    offset = math.sqrt(max(upper_arm**2 - along**2, 0.0))
    return shoulder + along * gap / reach + offset * aside / math.hypot(*aside)
