"""Who pushes, and with what: a hand-held tool on a tilted rod, an arm, a body that leans over the table."""

from dataclasses import dataclass, replace

import numpy as np

from anyview.scenes import looks
from anyview.scenes.shapes import Shape, Surface, box, capsule, ellipsoid, moved, pitch, yaw, z_along
from anyview.surrogate.arm import bend, lean
from anyview.surrogate.push import CUP_DEPTH, CUP_HALF_WIDTH
from anyview.trigonometry import unit_vector


@dataclass(frozen=True)
class Operator:
    """A tool, an arm and a body. Bodies are lists of shapes in frames of their own."""

    tool: list[Shape]  # its mouth looks along x
    forearm: list[Shape]  # along z, from the wrist
    upper_arm: list[Shape]  # along z, from the elbow
    torso: list[Shape]  # where it is when it does not lean
    tilt: float  # radians that the rod leans back from upright
    wrist: float  # metres along the rod
    shoulder: np.ndarray  # (3,)
    lengths: tuple[float, float]  # of upper arm and forearm
    outwards: np.ndarray  # (3,), where the elbow points

    def joints(self, cup: np.ndarray) -> np.ndarray:
        """Wrist, elbow and shoulder (3, 3) with the tool at ``cup`` (4,): x, y, height and heading."""
        x, y, height, heading = cup.tolist()
        back, up = unit_vector(self.tilt)[::-1] * self.wrist
        east, north = unit_vector(heading)
        wrist = np.array([x - back * east, y - back * north, height + 0.02 + up])
        shoulder = lean(self.shoulder, wrist, sum(self.lengths))
        return np.stack([wrist, bend(shoulder, wrist, *self.lengths, self.outwards), shoulder])

    def posed(self, cup: np.ndarray) -> list[Shape]:
        """All shapes with the tool at ``cup`` (4,), as ``joints`` has it."""
        x, y, height, heading = cup.tolist()
        wrist, elbow, shoulder = self.joints(cup)
        torso = (shoulder - self.shoulder) * (1.0, 1.0, 0.0)
        return [
            *moved(self.tool, (x, y, height), yaw(heading)),
            *moved(self.forearm, wrist, z_along(elbow - wrist)),
            *moved(self.upper_arm, elbow, z_along(shoulder - elbow)),
            *moved(self.torso, torso, yaw(0.0)),
        ]


def sample_operator(rng: np.random.Generator) -> Operator:
    """Anybody, left- or right-handed, sitting or standing, in any clothes."""
    skin = looks.surface(rng, looks.skin(rng))
    sleeve = Surface(
        looks.colour(rng), texture=2 if rng.random() < 0.4 else None, repeats=rng.uniform(0.5, 3.0)
    )
    if sleeve.texture is None and rng.random() < 0.4:  # people wear dark clothes
        sleeve = Surface(looks.hsv(rng.random(), rng.uniform(0.0, 0.5), rng.uniform(0.04, 0.35)))
    tilt, grip = rng.uniform(0.5, 1.0), rng.uniform(0.18, 0.30)
    side = 1.0 if rng.random() < 0.6 else -1.0
    shoulder = np.array([side * rng.uniform(0.08, 0.24), rng.uniform(-0.74, -0.55), rng.uniform(0.26, 0.48)])
    lengths = (rng.uniform(0.29, 0.36), rng.uniform(0.27, 0.34))
    outwards = np.array([side * rng.uniform(0.4, 1.0), rng.uniform(-0.4, 0.1), -rng.uniform(0.2, 0.8)])
    girth = rng.uniform(0.8, 1.25)
    bare = rng.choice([0.06, rng.uniform(0.06, lengths[1])]) if rng.random() < 0.7 else lengths[1]
    long_sleeves = bare < lengths[1] - 0.01
    forearm = [capsule((0, 0, 0), (0, 0, bare), 0.028 * girth, skin)]
    if long_sleeves:
        forearm.append(capsule((0, 0, bare), (0, 0, lengths[1]), 0.039 * girth, sleeve))
    else:
        forearm.append(capsule((0, 0, bare * 0.6), (0, 0, lengths[1]), 0.034 * girth, skin))
    bare_above = 0.0 if long_sleeves else rng.uniform(0.0, 0.7) * lengths[0]
    upper_arm = [capsule((0, 0, bare_above), (0, 0, lengths[0]), 0.050 * girth, sleeve)]
    if bare_above:
        upper_arm.append(capsule((0, 0, 0), (0, 0, bare_above), 0.041 * girth, skin))
    return Operator(
        tool=_tool(rng, tilt, grip, skin),
        forearm=forearm,
        upper_arm=upper_arm,
        torso=_torso(rng, shoulder, side, girth, sleeve, skin),
        tilt=tilt,
        wrist=grip + 0.05,
        shoulder=shoulder,
        lengths=lengths,
        outwards=outwards,
    )


def _tool(rng: np.random.Generator, tilt: float, grip: float, skin: Surface) -> list[Shape]:
    """The cup, most often a dark U, and the rod with the hand around it."""
    tone = looks.hsv(rng.random(), rng.uniform(0.0, 0.3), rng.uniform(0.02, 0.25))
    dark = looks.surface(rng, tone if rng.random() < 0.6 else looks.colour(rng))
    wood = looks.hsv(rng.uniform(0.05, 0.13), rng.uniform(0.2, 0.6), rng.uniform(0.4, 0.95))
    rod = looks.surface(rng, wood if rng.random() < 0.6 else looks.colour(rng))
    thick, high, bar = rng.uniform(0.003, 0.008), rng.uniform(0.010, 0.024), rng.uniform(0.004, 0.010)
    inner, middle = CUP_HALF_WIDTH, high + 0.002
    cup = [box((bar, inner + 2 * thick, high), (-bar, 0, middle), dark)]
    if rng.random() < 0.85:
        depth = CUP_DEPTH * rng.uniform(0.7, 1.0)
        for side in (-1, 1):
            cup.append(box((depth / 2, thick, high), (depth / 2, side * (inner + thick), middle), dark))
    size = rng.uniform(0.85, 1.15)
    rod_top = grip + rng.uniform(0.02, 0.14)
    along_rod = [
        capsule((0, 0, 0.005), (0, 0, rod_top), rng.uniform(0.005, 0.013), rod),
        ellipsoid((0.024 * size, 0.027 * size, 0.046 * size), (-0.012, 0, grip), skin),
        capsule((0.006, 0.010, grip - 0.05), (0.010, 0.034, grip - 0.018), 0.010 * size, skin),
        capsule((-0.008, 0, grip + 0.015), (-0.006, 0, grip + 0.05), 0.024 * size, skin),
    ]
    # Ellipsoids take half of the time of capsules; the hand's shadow is enough.
    fingers = replace(skin, casts_shadow=False)
    for finger in range(4):
        height = grip + 0.02 * size * (finger - 1.7)
        along_rod.append(ellipsoid((0.0105 * size, 0.032, 0.0105 * size), (0.017, 0.0035, height), fingers))
    return [*cup, *moved(along_rod, (-0.004, 0, 0.02), pitch(-tilt))]


def _torso(
    rng: np.random.Generator, shoulder: np.ndarray, side: float, girth: float, sleeve: Surface, skin: Surface
) -> list[Shape]:
    _, y, top = shoulder
    back = y - rng.uniform(0.04, 0.10)
    hair = looks.surface(
        rng, looks.hsv(rng.uniform(0.03, 0.12), rng.uniform(0.1, 0.7), rng.uniform(0.03, 0.7))
    )
    shapes = [
        ellipsoid((0.20 * girth, 0.13 * girth, 0.38), (0, back, top - 0.26), sleeve),
        ellipsoid((0.20 * girth, 0.10, 0.08), (0, back, top), sleeve),
        capsule((0, back, top + 0.06), (0, back + 0.02, top + 0.16), 0.05, skin),
        ellipsoid((0.078, 0.095, 0.115), (0, back + 0.05, top + 0.25), skin),
        ellipsoid((0.086, 0.098, 0.095), (0, back + 0.02, top + 0.29), hair),
    ]
    if rng.random() < 0.6:  # the other hand rests on the table
        elbow = np.array([-side * rng.uniform(0.22, 0.34), -0.47, 0.05])
        hand = np.array([-side * rng.uniform(0.12, 0.34), rng.uniform(-0.38, -0.27), 0.025])
        shapes += [
            capsule((-side * 0.19, back, top), elbow, 0.05 * girth, sleeve),
            capsule(elbow, hand, 0.036 * girth, sleeve),
            ellipsoid((0.038, 0.055, 0.02), hand + np.array((0.0, 0.05, 0.0)), skin),
        ]
    return shapes
