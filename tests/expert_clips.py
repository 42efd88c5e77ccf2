"""A small translator with random weights, demonstrations, and contexts that no evaluation uses."""

import numpy as np
import pytest
import torch

from anyview.pusher.contexts import Context, sample_contexts
from anyview.pusher.expert import roll_out
from anyview.pusher.render import renderer
from anyview.seeds import stream
from anyview.translator.network import ContextTranslator

SIZE = 32


@pytest.fixture(scope="session")
def translator() -> ContextTranslator:
    """Random weights, in evaluation mode."""
    torch.manual_seed(0)
    return ContextTranslator("compact", SIZE).eval().requires_grad_(False)


@pytest.fixture(scope="session")
def contexts() -> list[Context]:
    return sample_contexts(stream(0, "test"), 5)[0]


@pytest.fixture(scope="session")
def expert_clips(contexts: list[Context]) -> np.ndarray:
    """The expert in each of ``contexts``, uint8 (5, 50, 32, 32, 3)."""
    positions, _ = roll_out(contexts)
    camera = renderer("push", SIZE)
    return np.stack([camera.render_clip(*each) for each in zip(contexts, positions, strict=True)])
