"""From a file to params, or to a line that says what is wrong with it."""

from pathlib import Path
from typing import Any

from pydantic import ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from anyview.config.explanations import explain
from anyview.config.params import Params
from anyview.config.references import check_references
from anyview.runtime.errors import AnyviewError


def read_yaml(path: Path) -> Any:
    """Parse a YAML 1.2 file (so that ``1e-3`` is a number, as DVC reads it)."""
    try:
        return YAML(typ="safe", pure=True).load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise AnyviewError(f"{path}: no such file; run from the root of the repository") from None
    except (YAMLError, ValueError) as error:  # ValueErrors: bytes that are no text, the 99th of May
        raise AnyviewError(f"{path}: not valid YAML: {' '.join(str(error).split())}") from None
    except RecursionError:
        raise AnyviewError(f"{path}: not valid YAML: nested too deeply") from None


def parse_params(values: Any, name: str = "params.yaml") -> Params:
    """Check ``values``; the first impossible key is named, with every other one counted."""
    try:
        params = Params.model_validate(values)
    except ValidationError as error:
        raise AnyviewError(f"{name}: {explain(error)}") from None
    check_references(params, name)
    return params


def load_params(path: Path = Path("params.yaml")) -> Params:
    """Read and check ``params.yaml``."""
    return parse_params(read_yaml(path), str(path))
