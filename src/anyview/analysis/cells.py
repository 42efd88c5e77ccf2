"""The cells that the analysis knows by name: labels, groups and order."""

from collections.abc import Iterable

OURS, CLOCK, HUMAN = "ours", "clock", "human"
ADAM, ADADELTA, AUGMENTED, SIM = "real-adam", "real-adadelta", "real-augmented", "sim"

LABELS = {
    "ours": "Ours (DDPG, diverse)",
    "oracle": "Oracle (true view)",
    "liu": "Liu (TRPO, diverse)",
    "narrow-ddpg": "DDPG, narrow",
    "narrow-trpo": "TRPO, narrow",
    "tcn": "TCN embedding",
    "tpil": "TPIL",
    "gail": "GAIL",
    "choice": "Choice (20 clips)",
    "choice-one-clip": "one clip",
    "choice-framewise": "no task embedding",
    "choice-oracle": "Oracle (true view)",
    "choice-clock": "clock alone",
    "choice-tempo": "any tempo",
    "choice-tempo-by-step": "any tempo, by step",
    "clock": "Clock alone",
    "angles": "Ours (one clip)",
    "choice-angles": "Choice (one clip)",
    "human": "A hand's clips (20)",
    "human-xirl": "A hand's clips, XIRL",
    "reach": "Reach (20 clips)",
    "reach-oracle": "Reach, Oracle",
    "strike": "Strike (20 clips)",
    "strike-oracle": "Strike, Oracle",
    "sweep": "Sweep (20 clips)",
    "sweep-oracle": "Sweep, Oracle",
    "no-translation": "without L_tr",
    "no-reconstruction": "without L_rec",
    "no-alignment": "without L_align",
    "no-reconstruction-alignment": "without L_rec, L_align",
    "no-feature-reward": "without L_f",
    "no-image-reward": "without L_i",
}

ABLATIONS = tuple(cell for cell in LABELS if cell.startswith("no-"))
"""Figure 20: a loss of the translator, or a term of the reward, left out."""

FACTORIAL = (("narrow-trpo", "narrow-ddpg"), ("liu", OURS))
"""The 2x2 of data and learning: rows narrow and diverse contexts, columns Liu's learning and ours."""


def label(cell: str) -> str:
    """What a reader sees; a cell that a user added keeps its own name."""
    return LABELS.get(cell, cell)


def ablation(translator: str) -> str:
    """The method that has this translator of figure 20: `no-alignment` for `sim-no-alignment`."""
    return OURS if translator == SIM else translator.removeprefix(f"{SIM}-")


def in_order(cells: Iterable[str]) -> list[str]:
    """Known cells in the order of the labels, then the others by name."""
    known = list(LABELS)
    return sorted(cells, key=lambda cell: (known.index(cell) if cell in LABELS else len(known), cell))


def compared(cells: Iterable[str]) -> list[str]:
    """Cells of figure 19: every method that is no ablation."""
    return [cell for cell in in_order(cells) if cell not in ABLATIONS]


def ablated(cells: Iterable[str]) -> list[str]:
    """Cells of figure 20: `ours` and its ablations."""
    return [cell for cell in in_order(cells) if cell == OURS or cell in ABLATIONS]
