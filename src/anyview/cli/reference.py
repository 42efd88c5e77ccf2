"""docs/params.md, written from the typed models: ``python -m anyview.cli.reference > docs/params.md``."""

import types
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import annotated_types
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from anyview.config import Params, load_params

_HEAD = """# Params reference

Every key of `params.yaml`, written from the models in `src/anyview/config/` by
`python -m anyview.cli.reference`. Values are those of the committed `default` profile. Anything else in the
file (an unknown key, another type, a value out of range) is refused by its name before any work starts.
"""


def params_reference(params: Params) -> str:
    """The reference as Markdown, with the values of ``params``."""
    return _HEAD + "".join(_section(name, getattr(params, name)) for name in Params.model_fields)


def _section(key: str, value: BaseModel | dict[str, BaseModel]) -> str:
    return _cells(key, value) if isinstance(value, dict) else _block(key, value)


def _block(prefix: str, block: BaseModel) -> str:
    title = f"\n## `{prefix}`\n\n{(block.__doc__ or '').strip()}\n\n"
    rows, nested = [], []
    for name, field in type(block).model_fields.items():
        value, key = getattr(block, name), f"{prefix}.{name}"
        if isinstance(value, BaseModel | dict):
            nested.append(_section(key, value))
        else:
            rows.append(f"| `{key}` | {_kind(field)} | `{_shown(value)}` | {_about(field)} |\n")
    table = "| key | type | default | meaning |\n|---|---|---|---|\n" + "".join(rows) + "" if rows else ""
    return title + table + "".join(nested)


def _cells(key: str, cells: dict[str, BaseModel]) -> str:
    """One section for each kind of cell, and which cells are of that kind."""
    text = ""
    for kind in dict.fromkeys(type(cell) for cell in cells.values()):
        names = [name for name, cell in cells.items() if type(cell) is kind]
        text += f"\n## `{key}.<name>`: {(kind.__doc__ or '').strip()}\n\n"
        text += (
            f"Names: {', '.join(f'`{name}`' for name in names)}.\n\n"
            "| key | type | left out | meaning |\n|---|---|---|---|\n"
        )
        for name, field in kind.model_fields.items():
            text += f"| `{name}` | {_kind(field)} | {_left_out(field)} | {_about(field)} |\n"
    return text


def _about(field: FieldInfo) -> str:
    if field.description:
        return field.description
    doc = getattr(field.annotation, "__doc__", None)
    return (
        doc.strip()
        if doc and isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel)
        else ""
    )


def _left_out(field: FieldInfo) -> str:
    """What counts where a cell does not say."""
    default = field.get_default(call_default_factory=True)
    if field.is_required():
        return "refused"
    return "" if default is None else f"`{_shown(default)}`"


def _shown(value: Any) -> str:
    if isinstance(value, BaseModel):
        return "{" + ", ".join(f"{name}: {_shown(part)}" for name, part in value) + "}"
    return str(value).lower() if isinstance(value, bool) else str(value)


def _kind(field: FieldInfo) -> str:
    kind = _type_name(field.annotation)
    bounds = [bound for item in field.metadata if (bound := _bound(item))]
    return f"{kind}, {', '.join(bounds)}" if bounds else kind


def _type_name(annotation: Any) -> str:
    origin = get_origin(annotation)
    if origin is Annotated:
        inner, *metadata = get_args(annotation)
        flat = [m for item in metadata for m in getattr(item, "metadata", [item])]
        return ", ".join([_type_name(inner), *(bound for m in flat if (bound := _bound(m)))])
    if origin is Literal:
        return " or ".join(f"`{value}`" for value in get_args(annotation))
    if origin in (Union, types.UnionType):
        return " or ".join(_type_name(part) for part in get_args(annotation))
    if origin is list:
        return f"list of ({_type_name(get_args(annotation)[0])})"
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return "block of " + ", ".join(f"`{name}`" for name in annotation.model_fields)
    names = {int: "whole number", float: "number", str: "text", bool: "true or false", NoneType: "absent"}
    return names.get(annotation, str(annotation))


def _bound(item: Any) -> str | None:
    for kind, sign in (
        (annotated_types.Ge, "ge"),
        (annotated_types.Gt, "gt"),
        (annotated_types.Le, "le"),
        (annotated_types.Lt, "lt"),
    ):
        if isinstance(item, kind):
            words = {"ge": "at least", "gt": "above", "le": "at most", "lt": "below"}
            return f"{words[sign]} {getattr(item, sign)}"
    if isinstance(item, annotated_types.MultipleOf):
        return f"a multiple of {item.multiple_of}"
    return None


if __name__ == "__main__":
    print(params_reference(load_params(Path("params.yaml"))), end="")
