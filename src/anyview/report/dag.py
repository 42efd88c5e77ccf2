"""The pipeline as a picture, drawn from ``dvc.yaml``: one box a stage, implied edges left out."""

import html
import re
from collections.abc import Iterator
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

from anyview.runtime.errors import AnyviewError

Edges = dict[str, set[str]]

_REFERENCE = re.compile(r"\$\{([\w.-]+)\}")
_BOX_WIDTH, _BOX_HEIGHT, _GAP_X, _GAP_Y, _MARGIN = 168, 54, 36, 40, 8


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


def draw(stages: list[Stage]) -> str:
    """The stages that make something as an SVG element, top to bottom; the page's style sheet colours it."""
    stages = [stage for stage in stages if stage.outputs]
    edges = needed_edges(stages)
    # A stage stands right above its first follower: then few arrows pass behind another box.
    above_end: dict[str, int] = {}
    for name in _sorted(edges):
        above_end[name] = 1 + max((above_end[follower] for follower in edges[name]), default=-1)
    levels = range(max(above_end.values()), -1, -1)
    layers = [[stage.name for stage in stages if above_end[stage.name] == level] for level in levels]
    widest = max(len(layer) for layer in layers)
    width = widest * _BOX_WIDTH + (widest - 1) * _GAP_X + 2 * _MARGIN
    height = len(layers) * _BOX_HEIGHT + (len(layers) - 1) * _GAP_Y + 2 * _MARGIN
    places = {}
    for level, layer in enumerate(layers):
        row = len(layer) * _BOX_WIDTH + (len(layer) - 1) * _GAP_X
        for index, name in enumerate(layer):
            x = (width - row) / 2 + index * (_BOX_WIDTH + _GAP_X)
            places[name] = (x, _MARGIN + level * (_BOX_HEIGHT + _GAP_Y))
    arrows = [(maker.name, user) for maker in stages for user in sorted(edges[maker.name])]
    label = "The pipeline's stages: " + "; ".join(f"{maker} feeds {user}" for maker, user in arrows)
    return (
        f'<svg class="dag" viewBox="0 0 {width} {height}" role="img" aria-label="{html.escape(label)}" '
        f'style="max-width:{width}px">'
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8" markerHeight="8" '
        'orient="auto"><path d="M0 0 8 4 0 8z"/></marker></defs>'
        + "".join(_arrow(places[maker], places[user]) for maker, user in arrows)
        + "".join(_box(stage, *places[stage.name]) for stage in stages)
        + "</svg>"
    )


def _arrow(start: tuple[float, float], end: tuple[float, float]) -> str:
    x0, y0 = start[0] + _BOX_WIDTH / 2, start[1] + _BOX_HEIGHT
    x1, y1 = end[0] + _BOX_WIDTH / 2, end[1] - 1
    bend = (y1 - y0) / 2
    path = f"M{x0:g} {y0:g}C{x0:g} {y0 + bend:g} {x1:g} {y1 - bend:g} {x1:g} {y1:g}"
    return f'<path class="edge" marker-end="url(#tip)" d="{path}"/>'


def _box(stage: Stage, x: float, y: float) -> str:
    middle = x + _BOX_WIDTH / 2
    count = f"{len(stage.cells)} cells" if stage.cells else "one run"
    title = ": ".join(filter(None, (stage.name, stage.about, ", ".join(stage.cells))))
    return (
        f"<g><title>{html.escape(title)}</title>"
        f'<rect x="{x:g}" y="{y:g}" width="{_BOX_WIDTH}" height="{_BOX_HEIGHT}" rx="8"/>'
        f'<text class="stage" x="{middle:g}" y="{y + 23:g}">{html.escape(stage.name)}</text>'
        f'<text class="count" x="{middle:g}" y="{y + 42:g}">{count}</text></g>'
    )
