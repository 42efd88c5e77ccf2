"""Profiles: overlays on ``params.yaml`` that set the scale of a study (profiles/<name>.yaml).

``profiles/default.yaml`` holds every key that any profile sets; the others hold what differs from it. So one
profile can follow another in any order, and keys that no profile sets stay as they are.
"""

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from anyview.config import parse_params, read_yaml
from anyview.runtime.errors import AnyviewError
from anyview.runtime.outputs import write_atomically

DEFAULT = "default"
_FOLDER = Path("profiles")
_PARAMS = Path("params.yaml")

Keys = tuple[str, ...]


def profile_names() -> list[str]:
    """The profiles that there are, `default` first."""
    names = sorted(path.stem for path in _FOLDER.glob("*.yaml"))
    if DEFAULT not in names:
        raise AnyviewError(f"{_FOLDER / 'default.yaml'}: no such file; run from the root of the repository")
    return sorted(names, key=lambda name: name != DEFAULT)


def profile_values(name: str) -> dict[Keys, Any]:
    """What profile ``name`` sets: key path -> value."""
    names = profile_names()
    if name not in names:
        raise AnyviewError(f"{name}: no such profile; there are {', '.join(names)}")
    values = dict(_leaves(read_yaml(_FOLDER / f"{DEFAULT}.yaml")))
    for path, value in _leaves(read_yaml(_FOLDER / f"{name}.yaml")):
        if path not in values:
            raise AnyviewError(f"{_FOLDER / name}.yaml: {'.'.join(path)}: not in {DEFAULT}.yaml")
        values[path] = value
    return values


def differences(name: str, params: Path = _PARAMS) -> dict[str, tuple[Any, Any]]:
    """Where ``params`` differs from profile ``name``: dotted key -> (value in params, in the profile)."""
    present = dict(_leaves(read_yaml(params)))
    return {
        ".".join(path): (present.get(path), value)
        for path, value in profile_values(name).items()
        if present.get(path) != value
    }


def active_profile(params: Path = _PARAMS) -> str | None:
    """The profile whose values ``params`` holds, or None where it holds those of none."""
    return next((name for name in profile_names() if not differences(name, params)), None)


def apply_profile(name: str, params: Path = _PARAMS) -> dict[str, tuple[Any, Any]]:
    """Merge profile ``name`` into ``params``, comments and all else kept. Returns the differences before."""
    removed = differences(name, params)
    yaml = YAML()
    yaml.preserve_quotes = True
    yaml.width = 4096
    tree = yaml.load(params.read_text(encoding="utf-8"))
    for path, value in profile_values(name).items():
        branch = tree
        for key in path[:-1]:
            branch = branch.get(key) if isinstance(branch, dict) else None
        if not isinstance(branch, dict) or path[-1] not in branch:
            raise AnyviewError(f"{params}: {'.'.join(path)}: missing key")
        if isinstance(value, list) and isinstance(branch[path[-1]], list):
            branch[path[-1]][:] = value  # in place, so that it stays on one line
        elif branch[path[-1]] != value:
            branch[path[-1]] = value
    text = io.StringIO()
    yaml.dump(tree, text)
    parse_params(YAML(typ="safe", pure=True).load(text.getvalue()), f"{params} with profile {name}")
    if removed:
        write_atomically(params, text.getvalue())
    return removed


def _leaves(tree: Any, path: Keys = ()) -> Iterator[tuple[Keys, Any]]:
    """Every value below the mappings of ``tree``, with its path. Lists are values."""
    if isinstance(tree, dict):
        for key, branch in tree.items():
            yield from _leaves(branch, (*path, key))
    elif path:
        yield path, tree
