"""What pydantic finds, in a line."""

import reprlib
from typing import Any

from pydantic import ValidationError

from anyview.config.values import KeyRefused


def explain(error: ValidationError) -> str:
    """The first impossible key and why it is, with every other one counted."""
    # Unknown keys first: one that is missing beside them is most often the same one, misspelt.
    first, *others = sorted(error.errors(), key=lambda found: found["type"] != "extra_forbidden")
    loc = first["loc"]
    if loc[:2] in (("imitation", "cells"), ("beyond", "cells")):
        loc = loc[:3] + loc[4:]  # without the tag of the reward's kind
    refused = first.get("ctx", {}).get("error")
    if isinstance(refused, KeyRefused):
        loc = (*loc, refused.key)
    key = ".".join(str(part) for part in loc if part != "[key]") or "the file"
    if first["type"] == "extra_forbidden":
        message = "unknown key"
    elif first["type"] == "missing":
        message = "missing key"
    else:
        message = first["msg"].removeprefix("Value error, ")
        if first["type"].startswith("union_tag"):
            key += ".reward"
            last = "goal" if loc[0] == "beyond" else "embedding"
            message = f"Input should be 'translated', 'true', 'clock' or '{last}'"
        if not isinstance(first["input"], dict | list | set):  # aliases can make these endless
            message += f", got {brief(first['input'])}"
    return f"{key}: {message}" + (f" (and {len(others)} more)" if others else "")


def brief(value: Any) -> str:
    """A value, short enough for a line."""
    try:
        return reprlib.repr(value)
    except ValueError:  # Python refuses to write out numbers of thousands of digits
        return "a giant number"
