"""A translator on disk."""

from pathlib import Path
from typing import Any

from torch import Tensor

from anyview.runtime.errors import AnyviewError
from anyview.runtime.models import read_description, read_weights, write_model
from anyview.translator.architectures import Translator, make_translator

_LARGEST = 256  # pixels


def save_translator(folder: Path, model: Translator, meta: dict[str, Any]) -> None:
    """Write weights, a shared encoder's once, and description: architecture, image size and ``meta``."""
    state = {
        name: value
        for name, value in model.state_dict().items()
        if not (model.shared and name.startswith("context_encoder."))
    }
    layers = {"architecture": model.architecture, "image_size": model.image_size}
    if model.task_embedding:
        layers["task_embedding"] = True
    write_model(folder, state, {**layers, **meta})


def read_meta(folder: Path) -> dict[str, Any]:
    """The description of a saved translator. Raises AnyviewError if there is none in ``folder``."""
    description = read_description(folder, {"image_size": _LARGEST})
    if not isinstance(description.get("architecture"), str):
        raise AnyviewError(f"{folder / 'model.json'}: no translator: the key architecture is missing")
    return description


def load_translator(folder: Path) -> Translator:
    """The saved translator, float32 on the CPU, in evaluation mode with no gradients.

    Raises AnyviewError if a file is missing, damaged or does not fit the other.
    """
    meta = read_meta(folder)
    model = make_translator(meta["architecture"], meta["image_size"], meta.get("task_embedding") is True)

    def restore(state: dict[str, Tensor]) -> None:
        if model.shared:
            state |= {name.replace("expert_encoder.", "context_encoder.", 1): state[name] for name in state}
        model.load_state_dict(state)

    read_weights(folder, restore)
    return model.eval().requires_grad_(False)
