"""The report page: one HTML file that opens offline, with every picture, style and script inside."""

import html
import io
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from ruamel.yaml import YAML

from anyview.report import exhibits_imitation, exhibits_translation, overview
from anyview.report.content import Section, Table, view
from anyview.report.dag import draw, read_stages
from anyview.report.inputs import Study
from anyview.report.metrics import Tree
from anyview.report.pictures import svg_uri
from anyview.report.provenance import dvc_hash
from anyview.report.words import subscripts
from anyview.runtime.scratch import content_key

_FOLDER = Path(__file__).parent


def sections(study: Study, data: Tree, translation: Tree, imitation: Tree) -> list[Section]:
    """The page's chapters; a chapter with nothing to show is left out."""
    chapters = [overview.section(study, data)]
    if study.translations or study.trainings:
        chapters.append(exhibits_translation.section(study, translation))
    if study.evaluations:
        chapters.append(exhibits_imitation.section(study, imitation))
    return chapters


def render(
    study: Study,
    chapters: list[Section],
    translation: Tree,
    imitation: Tree,
    pipeline: Any,
    inputs: Iterable[Path],
) -> str:
    """The page as HTML. ``pipeline`` is the parsed ``dvc.yaml``; ``inputs`` are what was read."""
    params = study.params.model_dump()
    environment = Environment(
        loader=FileSystemLoader(_FOLDER), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    environment.filters["svg_uri"] = svg_uri
    environment.filters["sub"] = lambda text: subscripts(html.escape(text), "L<sub>{}</sub>")
    idea = overview.idea_strip(study)
    stages = read_stages(pipeline, params)
    hashes = tuple((path.as_posix(), dvc_hash(path)) for path in inputs)
    return environment.get_template("page.html").render(
        style=_asset("page.css"),
        script=_asset("page.js"),
        strip_of_idea=view(idea) if idea else None,
        caption_of_idea=overview.IDEA,
        headlines=list(overview.headlines(translation, imitation)),
        surrogate=study.surrogate and any(study.is_real(cell) for cell in study.translations),
        sections=chapters,
        dag=draw(stages),
        stages=Table(("Stage", "Makes"), tuple((stage.name, stage.about) for stage in stages)),
        params_key=content_key(params)[:12],
        inputs_key=content_key(hashes)[:12],
        inputs=Table(("Input", "DVC hash"), hashes),
        params_text=_yaml(params),
    )


def write_figures(folder: Path, chapters: list[Section]) -> None:
    """Each figure of the page as an SVG file of its own."""
    folder.mkdir(parents=True)
    for key, svg in _figures(chapters):
        (folder / f"{key}.svg").write_text(svg, encoding="utf-8")


def _figures(chapters: list[Section]) -> Iterator[tuple[str, str]]:
    for chapter in chapters:
        for exhibit in chapter.exhibits:
            if exhibit.figure:
                yield exhibit.key, exhibit.figure


def _asset(name: str) -> str:
    return (_FOLDER / name).read_text(encoding="utf-8")


def _yaml(values: Any) -> str:
    buffer = io.StringIO()
    YAML(typ="safe", pure=True).dump(values, buffer)
    return buffer.getvalue()
