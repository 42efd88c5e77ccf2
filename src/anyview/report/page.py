"""The report page: one HTML file that opens offline, with every picture, style and script inside."""

import html
import io
import itertools
import re
from collections.abc import Sequence
from typing import Any

from markdown_it import MarkdownIt
from markdown_it.renderer import RendererHTML
from markdown_it.token import Token
from markdown_it.utils import OptionsDict
from ruamel.yaml import YAML

from anyview.analysis.study import Study
from anyview.report.dag import draw, read_stages
from anyview.report.formatting import subscripts
from anyview.report.illustrations import Illustrations
from anyview.report.pictures import row_uri, svg_uri
from anyview.report.provenance import dvc_hash
from anyview.report.text import TEMPLATES, environment
from anyview.runtime.scratch import content_key

_PICTURE = "picture"  # a fence of this kind holds the name of an illustration


def picture(name: str) -> str:
    """Where the illustration ``name`` belongs in the Markdown of the page."""
    return f"```{_PICTURE}\n{name}\n```"


def render_page(markdown: str, illustrations: Illustrations, study: Study, pipeline: Any) -> str:
    """The page as HTML. ``pipeline`` is the parsed ``dvc.yaml``."""
    params = study.params.model_dump()
    stages = read_stages(pipeline, params)
    del params["beyond"]  # it is another pipeline's, or is what stands in place of the thesis's blocks
    templates = environment(autoescape=True)
    templates.filters |= {"svg_uri": svg_uri, "row_uri": row_uri, "subscripts": _subscripts}
    macros = templates.get_template("pictures.html.jinja").module
    parser = MarkdownIt("commonmark", {"html": False}, renderer_cls=_Renderer).enable("table")
    tokens = parser.parse(markdown)
    chapters = [
        index for index, token in enumerate(tokens) if token.type == "heading_open" and token.tag == "h2"
    ]
    env: dict[str, Any] = {"illustrations": illustrations, "macros": macros, "open": []}
    hashes = tuple((path.as_posix(), dvc_hash(path)) for path in study.sources)
    return templates.get_template("page.html.jinja").render(
        style=(TEMPLATES / "page.css").read_text(encoding="utf-8"),
        script=(TEMPLATES / "page.js").read_text(encoding="utf-8"),
        opening=parser.renderer.render(tokens[: chapters[0]], parser.options, env),
        body=parser.renderer.render(tokens[chapters[0] :], parser.options, env) + _close(env["open"]),
        chapters=[(_slug(title), title) for title in (tokens[index + 1].content for index in chapters)],
        dag=draw(stages, templates),
        stages=stages,
        params_key=content_key(params)[:12],
        inputs_key=content_key(hashes)[:12],
        inputs=hashes,
        params_text=_yaml(params),
    )


class _Renderer(RendererHTML):
    """Chapters become sections and what is under a heading an article; tables scroll on their own.

    A method renders the token of its name; ``env`` holds the illustrations, and what is still open.
    """

    def text(self, tokens: Sequence[Token], idx: int, options: OptionsDict, env: Any) -> str:
        """Text with its subscripts."""
        return _subscripts(tokens[idx].content)

    def fence(self, tokens: Sequence[Token], idx: int, options: OptionsDict, env: Any) -> str:
        """The illustration that ``picture`` names; nothing where the study does not allow it."""
        name, macros, shown = tokens[idx].content.strip(), env["macros"], env["illustrations"]
        if name in shown.figures:
            return macros.figure(env["title"], shown.figures[name])
        if name in shown.strips:
            return macros.strip(shown.strips[name])
        return macros.player(env["title"], shown.players[name]) if name in shown.players else ""

    def heading_open(self, tokens: Sequence[Token], idx: int, options: OptionsDict, env: Any) -> str:
        """Close what this heading ends, open what it begins."""
        tag, title = tokens[idx].tag, tokens[idx + 1].content
        env["title"] = title.replace("`", "")
        if tag == "h1":
            return "<h1>"
        element = "section" if tag == "h2" else "article"
        closing = _close(env["open"], down_to=element)
        env["open"].append(element)
        return f'{closing}<{element} id="{_slug(title)}">\n<{tag}>'

    def table_open(self, tokens: Sequence[Token], idx: int, options: OptionsDict, env: Any) -> str:
        """A table with the thesis's numbers stands beside the figure, any other below it."""
        head = itertools.takewhile(lambda token: token.type != "thead_close", tokens[idx:])
        headings = [token.content for token in head if token.type == "inline"]
        kind = "beside" if "Thesis" in headings else "wide" if len(headings) > 4 else ""
        return f'<div class="scroll {kind}" tabindex="0" role="region" aria-label="Table"><table>\n'

    def table_close(self, tokens: Sequence[Token], idx: int, options: OptionsDict, env: Any) -> str:
        """See ``table_open``."""
        return "</table></div>\n"

    def th_open(self, tokens: Sequence[Token], idx: int, options: OptionsDict, env: Any) -> str:
        """A column's heading."""
        return '<th scope="col">'

    def td_open(self, tokens: Sequence[Token], idx: int, options: OptionsDict, env: Any) -> str:
        """A cell; the first of a row is the row's heading."""
        env["cell"] = "th" if tokens[idx - 1].type == "tr_open" else "td"
        return '<th scope="row">' if env["cell"] == "th" else "<td>"

    def td_close(self, tokens: Sequence[Token], idx: int, options: OptionsDict, env: Any) -> str:
        """See ``td_open``."""
        return f"</{env['cell']}>"


def _close(elements: list[str], down_to: str = "section") -> str:
    """Closing tags of the open ``elements``, the innermost first, up to and with ``down_to``."""
    closing = ""
    while down_to in elements:
        closing += f"</{elements.pop()}>\n"
    return closing


def _slug(title: str) -> str:
    """The id of a heading, from its first sentence: ``figure-13``."""
    return re.sub(r"\W+", "-", re.split(r"[.,:`]", title.replace("’", ""))[0].strip().lower())


def _subscripts(text: str) -> str:
    return subscripts(html.escape(text), "L<sub>{}</sub>")


def _yaml(values: Any) -> str:
    buffer = io.StringIO()
    YAML(typ="safe", pure=True).dump(values, buffer)
    return buffer.getvalue()
