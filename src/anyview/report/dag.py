"""The pipeline as a picture, drawn from ``dvc.yaml``: one box a stage, implied edges left out.

``dvc dag --collapse-foreach-matrix --mermaid`` names stages and edges too, also while a stage runs. But a
browser draws that with megabytes of script only, and the page is one small file that opens offline; it has
neither the cells nor the descriptions; and it needs a DVC repository around the results.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

from jinja2 import Environment

from anyview.runtime.errors import AnyviewError

Edges = dict[str, set[str]]
Stop = str | tuple[str, str]

_REFERENCE = re.compile(r"\$\{([\w.-]+)\}")


@dataclass(frozen=True)
class Stage:
    """A stage of ``dvc.yaml``: its cells (none without ``foreach``), and what they read and write."""

    name: str
    about: str
    cells: tuple[str, ...]
    inputs: frozenset[str]
    outputs: frozenset[str]


def read_stages(pipeline: Any, params: Any, path: Path = Path("dvc.yaml")) -> list[Stage]:
    """The stages of a parsed ``dvc.yaml``; ``params`` are the values that its ``${...}`` name."""
    try:
        return [_stage(name, body, params) for name, body in pipeline["stages"].items()]
    except (KeyError, TypeError, AttributeError) as error:
        raise AnyviewError(f"{path}: cannot read its stages ({type(error).__name__}: {error})") from None


def _stage(name: str, body: dict[str, Any], params: Any) -> Stage:
    if "do" not in body:
        paths = _paths(body, params)
        return Stage(name, body.get("desc", ""), (), *paths)
    declared = body["foreach"]
    if isinstance(declared, str):
        declared = _look_up(_REFERENCE.fullmatch(declared)[1], params)  # type: ignore[index]
    items = declared if isinstance(declared, dict) else {str(item): item for item in declared}
    inputs: set[str] = set()
    outputs: set[str] = set()
    for key, item in items.items():
        read, written = _paths(body["do"], {**params, "key": key, "item": item})
        inputs |= read
        outputs |= written
    return Stage(name, body["do"].get("desc", ""), tuple(items), frozenset(inputs), frozenset(outputs))


def _paths(body: dict[str, Any], values: Any) -> tuple[frozenset[str], frozenset[str]]:
    """(inputs, outputs) with every ``${...}`` filled in."""

    def filled(*keys: str) -> Iterator[str]:
        for entry in (entry for key in keys for entry in body.get(key) or ()):
            path = entry if isinstance(entry, str) else next(iter(entry))
            yield _REFERENCE.sub(lambda match: str(_look_up(match[1], values)), path)

    return frozenset(filled("deps")), frozenset(filled("outs", "metrics", "plots"))


def _look_up(dotted: str, values: Any) -> Any:
    for key in dotted.split("."):
        values = values[key]
    return values


def needed_edges(stages: list[Stage]) -> Edges:
    """For each stage, the stages that directly follow it; edges that longer paths imply are left out."""
    followers: Edges = {
        maker.name: {user.name for user in stages if maker is not user and _feeds(maker, user)}
        for maker in stages
    }
    reached: Edges = {}
    for name in _sorted(followers):
        reached[name] = followers[name].union(*(reached[follower] for follower in followers[name]))
    return {
        name: {end for end in ends if not any(end in reached[other] for other in ends)}
        for name, ends in followers.items()
    }


def _feeds(maker: Stage, user: Stage) -> bool:
    return any(
        path == output or path.startswith(output + "/") for output in maker.outputs for path in user.inputs
    )


def _sorted(followers: Edges) -> list[str]:
    """Stages, each after all of its followers."""
    try:
        return list(TopologicalSorter(followers).static_order())
    except CycleError:
        raise AnyviewError("dvc.yaml: its stages depend on each other in a circle") from None


def layers(edges: Edges) -> list[list[Stop]]:
    """What stands beside each other, top to bottom: stages, and the edges that pass between them.

    Each stage stands right above its first follower.
    """
    above_end: dict[str, int] = {}
    for name in _sorted(edges):
        above_end[name] = 1 + max((above_end[follower] for follower in edges[name]), default=-1)
    arrows = [(maker, user) for maker in edges for user in sorted(edges[maker])]
    order = {name: index for index, name in enumerate(edges)}
    rows: list[list[Stop]] = []
    for level in range(max(above_end.values(), default=-1), -1, -1):
        stages = [name for name in edges if above_end[name] == level]
        passing = [(maker, user) for maker, user in arrows if above_end[user] < level < above_end[maker]]
        rows.append(
            sorted([*stages, *passing], key=lambda stop: order[stop if isinstance(stop, str) else stop[1]])
        )
    return rows


def draw(stages: list[Stage], templates: Environment) -> str:
    """The stages that make something as an SVG element; the page's style sheet colours it."""
    shown = {stage.name: stage for stage in stages if stage.outputs}
    edges = needed_edges(list(shown.values()))
    rows = layers(edges)
    boxes: dict[str, tuple[float, int]] = {}
    arrows: dict[tuple[str, str], list[tuple[float, int]]] = {}
    for level, row in enumerate(rows):
        for index, stop in enumerate(row):
            place = (index - len(row) / 2, level)
            if isinstance(stop, str):
                boxes[stop] = place
            else:
                arrows.setdefault(stop, []).append(place)
    return templates.get_template("dag.svg.jinja").render(
        stages=shown,
        boxes=boxes,
        arrows={
            (maker, user): [boxes[maker], *arrows.get((maker, user), []), boxes[user]]
            for maker in shown
            for user in sorted(edges[maker])
        },
        columns=max(len(row) for row in rows),
        rows=len(rows),
    )
