"""An embedding on disk."""

from pathlib import Path
from typing import Any

from anyview.embedding.network import Embedding
from anyview.runtime.models import read_description, read_weights, write_model

_LARGEST = 1024  # pixels and dimensions


def save_embedding(folder: Path, model: Embedding, meta: dict[str, Any]) -> None:
    """Write the weights and a description: image size, dimensions and ``meta`` (JSON-serialisable)."""
    description = {"image_size": model.image_size, "dimensions": model.dimensions, **meta}
    write_model(folder, model.state_dict(), description)


def load_embedding(folder: Path) -> Embedding:
    """The saved embedding, float32 on the CPU, in evaluation mode with no gradients.

    Raises AnyviewError if a file is missing, damaged or does not fit the other.
    """
    meta = read_description(folder, {"image_size": _LARGEST, "dimensions": _LARGEST})
    model = Embedding(meta["image_size"], meta["dimensions"])
    read_weights(folder, model.load_state_dict)
    return model.eval().requires_grad_(False)
