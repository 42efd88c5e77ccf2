"""One entry of dvc.lock, written as DVC writes it, without reading and writing all the others.

DVC parses and dumps the whole file for every stage, slowly, because it preserves comments: with 176 stages
this is most of its overhead. Here the entry's text is DVC's own, and the text around it stays as it is.
"""

import re
from collections.abc import Collection
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from anyview.runtime.outputs import write_atomically

if TYPE_CHECKING:
    from dvc.stage import PipelineStage

_EMPTY = "schema: '2.0'\nstages:\n"
_STAGES = re.compile(r"^stages:\n((?:[ \n#].*\n?|\n)*)", re.MULTILINE)
_ENTRY = re.compile(r"^  (?=[^ \n#])", re.MULTILINE)


def names_in(path: Path) -> frozenset[str]:
    """Stages that the lock file at ``path`` has an entry for."""
    blocks = _split(path.read_text(encoding="utf-8")) if path.exists() else None
    return frozenset(blocks[1]) if blocks else frozenset()


def write_entry(stage: "PipelineStage", later: Collection[str]) -> None:
    """Put the entry of ``stage`` into its lock file, in the place of an older one or else before ``later``.

    ``later`` are the stages that plain ``dvc repro`` would add after this one, so that the file becomes the
    same whatever order stages end in. DVC's lock of the repository must be held.
    """
    from dvc.stage.serialize import to_lockfile
    from dvc.utils.serialize import dumps_yaml

    path = Path(stage.dvcfile._lockfile.path)
    text = path.read_text(encoding="utf-8") if path.exists() else _EMPTY
    block = dumps_yaml({"stages": to_lockfile(stage)}).removeprefix("stages:\n")
    spliced = splice(text, stage.name, block, later)
    if spliced is None:  # edited by hand, perhaps: DVC knows more layouts
        stage.dump(update_pipeline=False)
    else:
        write_atomically(path, spliced)
        stage.repo.scm_context.track_file(stage.dvcfile._lockfile.relpath)


def splice(text: str, name: str, block: str, later: Collection[str]) -> str | None:
    """``text`` of a lock file with ``block`` for the stage ``name``; None if its layout is not DVC's."""
    parts = _split(text)
    if parts is None:
        return None
    head, blocks, tail = parts
    if name in blocks:
        blocks[name] = block
    else:
        names = [*blocks]
        place = next((index for index, each in enumerate(names) if each in later), len(names))
        blocks[name] = block
        names.insert(place, name)
        blocks = {each: blocks[each] for each in names}
    return head + "".join(blocks.values()) + tail


def _split(text: str) -> tuple[str, dict[str, str], str] | None:
    """What stands before the entries, each entry's text by its stage, what stands after; None if unclear."""
    from dvc.utils.serialize import loads_yaml

    found = _STAGES.search(text)
    if found is None:
        return None
    starts = [each.start() for each in _ENTRY.finditer(found[1])] + [len(found[1])]
    if starts[0]:  # a comment before the first entry
        return None
    blocks = {}
    for start, end in pairwise(starts):
        block = found[1][start:end]
        key, _, _ = block.partition("\n")
        if not key.endswith(":"):
            return None
        named = key.strip()[:-1]
        blocks[str(loads_yaml(named)) if named[0] in "'\"" else named] = block
    return text[: found.start(1)], blocks, text[found.end(1) :]
