"""The report's numbers as Markdown, for a document in Git: what the page says, without its pictures."""

from collections.abc import Iterator

from anyview.report.content import Section, Table


def digest(chapters: list[Section]) -> str:
    """Headings, texts and tables of ``chapters``; the thesis's numbers stand first, as on the page."""
    return "\n\n".join(block for chapter in chapters for block in _chapter(chapter)) + "\n"


def _chapter(chapter: Section) -> Iterator[str]:
    yield f"## {chapter.title}"
    yield from chapter.text
    for exhibit in chapter.exhibits:
        tables = [table for table in (exhibit.comparison, exhibit.table) if table is not None]
        if not (tables or exhibit.text):
            continue
        yield f"### {exhibit.title}"
        if exhibit.surrogate:
            yield "*On surrogate clips: the thesis’s own are not published.*"
        yield from exhibit.text
        for table in tables:
            if table.caption:
                yield f"*{table.caption}*"
            yield _table(table)


def _table(table: Table) -> str:
    """A table of Markdown; a bar inside a cell is escaped."""
    ruled = (table.headings, ("---",) * len(table.headings), *table.rows)
    escaped = ([cell.replace("|", r"\|") for cell in row] for row in ruled)
    return "\n".join(f"| {' | '.join(row)} |" for row in escaped)
