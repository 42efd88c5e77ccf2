"""A translator on disk: ``weights.safetensors`` beside ``model.json``, both readable without running code."""

import json
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors.torch import load, save

from anyview.runtime.errors import AnyviewError
from anyview.runtime.outputs import write_atomically
from anyview.translator.network import ContextTranslator

_WEIGHTS = "weights.safetensors"
_MODEL = "model.json"
_LARGEST = 256  # pixels: a file that asks for more is damaged, and would take all the memory


def stored_state(model: ContextTranslator) -> dict[str, torch.Tensor]:
    """The model's weights by name, float32 on the CPU; a shared encoder once."""
    return {
        name: tensor.detach().to("cpu", torch.float32).contiguous()
        for name, tensor in model.state_dict().items()
        if not (model.shared and name.startswith("context_encoder."))
    }


def restore_state(model: ContextTranslator, state: dict[str, torch.Tensor]) -> None:
    """Load what ``stored_state`` gave; RuntimeError where names or shapes differ."""
    if model.shared:
        twins = {name.replace("expert_encoder.", "context_encoder.", 1): state[name] for name in state}
        state = twins | state
    model.load_state_dict(state)


def save_translator(folder: Path, model: ContextTranslator, meta: dict[str, Any]) -> None:
    """Write the weights, and ``model.json``: architecture, image size and ``meta`` (JSON-serialisable)."""
    write_atomically(folder / _WEIGHTS, save(stored_state(model)))
    described = {"architecture": model.architecture, "image_size": model.image_size, **meta}
    write_atomically(folder / _MODEL, json.dumps(described, indent=2, sort_keys=True) + "\n")


def read_meta(folder: Path) -> dict[str, Any]:
    """``model.json`` of a saved translator."""
    path = folder / _MODEL
    try:
        meta = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise AnyviewError(
            f"{path}: no such file; train the cell first, or name a folder that holds a model"
        ) from None
    except (ValueError, RecursionError) as error:
        raise AnyviewError(f"{path}: not valid JSON: {error}") from None
    if not isinstance(meta, dict) or not isinstance(meta.get("architecture"), str):
        raise AnyviewError(f"{path}: no translator: the key architecture is missing")
    size = meta.get("image_size")
    if not isinstance(size, int) or not 0 < size <= _LARGEST:
        raise AnyviewError(f"{path}: image_size must be a whole number from 1 to {_LARGEST}")
    return meta


def load_translator(folder: Path) -> ContextTranslator:
    """The saved translator, float32 on the CPU, in evaluation mode with no gradients."""
    meta = read_meta(folder)
    model = ContextTranslator(meta["architecture"], meta["image_size"])
    path = folder / _WEIGHTS
    try:
        restore_state(model, load(path.read_bytes()))
    except FileNotFoundError:
        raise AnyviewError(f"{path}: no such file; train the cell first") from None
    except SafetensorError as error:
        raise AnyviewError(f"{path}: not a safetensors file: {error}") from None
    except RuntimeError:
        raise AnyviewError(f"{path}: does not hold the weights that {_MODEL} beside it describes") from None
    return model.eval().requires_grad_(False)
