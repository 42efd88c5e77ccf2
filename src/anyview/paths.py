"""Where the pipeline keeps what it makes, relative to the root of the repository."""

from pathlib import Path

DATA = Path("data")
METRICS = Path("metrics")
REPORT = DATA / "report"
RANKINGS = DATA / "rankings"  # scripted rollouts under the rewards of methods
BEYOND = DATA / "beyond"  # the report on what goes beyond the thesis

REAL = "real"  # the set of clips that ingest makes
RENDERED = "rendered"  # the set that stage render makes; the others are simulated

ANY_VIEW = "any"  # of the sets that evidence restricts: seen from anywhere, as the set that they show
CLUTTER = ("plain", "distractors")
EVALUATIONS = ("own", "diverse")  # of their translators: see evidence/dvc.yaml


def raw(source: str) -> Path:
    """Video files as a camera left them: ``surrogate`` or ``recorded``."""
    return DATA / "raw" / source


def clip_set(name: str) -> Path:
    """A set of clips (see ``video.sets``)."""
    return DATA / "clips" / name


def split_table(name: str) -> Path:
    """Which clips of the set ``name`` train, validate and are extreme."""
    return DATA / "splits" / f"{name}.csv"


def model(cell: str) -> Path:
    """Weights of a translator or an embedding."""
    return DATA / "models" / cell


def translations(cell: str) -> Path:
    """What a translator makes of held-out clips."""
    return DATA / "translations" / cell


def policies(cell: str) -> Path:
    """Policies of a method and how they end."""
    return DATA / "policies" / cell


def replicate(translator: str, seed: int, policies: str = "") -> str:
    """Name of one of several trainings of a translator, and of its ``policies``, of which there are kinds."""
    return f"{translator}-seed-{seed}" + (f"-{policies}" if policies else "")


def restricted_set(views: str, clutter: str) -> str:
    """Name of the set of clips from so many ``views``, or ``ANY_VIEW``, with or without distractors."""
    return f"views-{views}-{clutter}"


def headline(cell: str) -> str:
    """Name of a cell whose seeds are compared at full budget, before ``replicate`` adds its seed."""
    return f"headline-{cell}"
