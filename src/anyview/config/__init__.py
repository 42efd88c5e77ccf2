"""``params.yaml`` as strict typed models: an unknown or impossible key is refused by its dotted name."""

from anyview.config.data import Ingest
from anyview.config.imitation import (
    DDPG,
    TRPO,
    AdversarialCell,
    BeyondCell,
    DemonstrationCell,
    Discriminator,
    EmbeddingRewardCell,
    GoalCell,
    ImitationCell,
    Incomplete,
    RewardWeights,
)
from anyview.config.params import Params
from anyview.config.reading import load_params, parse_params, read_yaml
from anyview.config.translators import (
    Assessment,
    CycleCell,
    EmbeddingCell,
    LossWeights,
    Pretraining,
    Training,
    TranslatorCell,
)

__all__ = [
    "DDPG",
    "TRPO",
    "AdversarialCell",
    "Assessment",
    "BeyondCell",
    "CycleCell",
    "DemonstrationCell",
    "Discriminator",
    "EmbeddingCell",
    "EmbeddingRewardCell",
    "GoalCell",
    "ImitationCell",
    "Incomplete",
    "Ingest",
    "LossWeights",
    "Params",
    "Pretraining",
    "RewardWeights",
    "Training",
    "TranslatorCell",
    "load_params",
    "parse_params",
    "read_yaml",
]
