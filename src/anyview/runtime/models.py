"""Model folders: ``weights.safetensors`` beside ``model.json``, both readable without running code."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from safetensors import SafetensorError
from safetensors.torch import load, save
from torch import Tensor

from anyview.runtime.errors import AnyviewError
from anyview.runtime.outputs import write_atomically

_WEIGHTS = "weights.safetensors"
_DESCRIPTION = "model.json"


def write_model(folder: Path, state: Mapping[str, Tensor], description: Mapping[str, Any]) -> None:
    """Write the weights ``state`` by name, as float32, and the JSON-serialisable ``description``."""
    weights = {name: value.detach().float().cpu().contiguous() for name, value in state.items()}
    write_atomically(folder / _WEIGHTS, save(weights))
    write_atomically(folder / _DESCRIPTION, json.dumps(dict(description), indent=2, sort_keys=True) + "\n")


def read_description(folder: Path, sizes: Mapping[str, int]) -> dict[str, Any]:
    """``model.json``, whose keys ``sizes`` must be whole numbers from 1 to the limit of each.

    A file that asks for more is damaged: its network would take all the memory.
    Raises AnyviewError if there is no such file, or if a key is missing or beyond its limit.
    """
    path = folder / _DESCRIPTION
    try:
        description = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise AnyviewError(
            f"{path}: no such file; train the cell first, or name a folder that holds a model"
        ) from None
    except (ValueError, RecursionError) as error:
        raise AnyviewError(f"{path}: not valid JSON: {error}") from None
    if not isinstance(description, dict):
        raise AnyviewError(f"{path}: does not describe a model")
    for key, largest in sizes.items():
        value = description.get(key)
        if not isinstance(value, int) or isinstance(value, bool) or not 0 < value <= largest:
            raise AnyviewError(f"{path}: {key} must be a whole number from 1 to {largest}")
    return description


def read_weights(folder: Path, restore: Callable[[dict[str, Tensor]], object]) -> None:
    """Hand the stored weights to ``restore``, which raises RuntimeError if they are of another network.

    Raises AnyviewError if the file is missing, damaged or of another network.
    """
    path = folder / _WEIGHTS
    try:
        restore(load(path.read_bytes()))
    except FileNotFoundError:
        raise AnyviewError(f"{path}: no such file; train the cell first") from None
    except SafetensorError as error:
        raise AnyviewError(f"{path}: not a safetensors file: {error}") from None
    except RuntimeError:
        raise AnyviewError(
            f"{path}: does not hold the weights that {_DESCRIPTION} beside it describes"
        ) from None
