"""Entries spliced into dvc.lock against the file that DVC itself writes."""

from random import Random

from dvc.utils.serialize import dumps_yaml
from ruamel.yaml import YAML

from anyview.parallel.lockfile import splice

EMPTY = "schema: '2.0'\nstages:\n"


def test_any_order_gives_the_file_that_dvc_wrote(root):
    """The study's own lock, written by plain `dvc repro`, from entries that come in any order."""
    text = (root / "dvc.lock").read_text()
    entries = YAML(typ="safe").load(text)["stages"]
    names = list(entries)
    blocks = {name: dumps_yaml({"stages": {name: entries[name]}}).removeprefix("stages:\n") for name in names}
    for seed in range(3):
        spliced = EMPTY
        for name in Random(seed).sample(names, len(names)):
            spliced = splice(spliced, name, blocks[name], names[names.index(name) + 1 :])
        assert spliced == text
    assert splice(text, names[3], blocks[names[3]], ()) == text


def test_what_stands_around_an_entry_stays():
    text = "# ours\nschema: '2.0'\nstages:\n  a:\n    cmd: 1  # why\n  'b: c':\n    cmd: 2\ndatasets:\n- x\n"
    assert splice(text, "b: c", "  'b: c':\n    cmd: 3\n", ()) == text.replace("cmd: 2", "cmd: 3")
    assert splice(text, "d", "  d:\n    cmd: 4\n", ()) == text.replace(
        "datasets", "  d:\n    cmd: 4\ndatasets"
    )


def test_a_layout_that_is_not_dvcs_is_left_to_dvc():
    for text in ("", "schema: '2.0'\nstages: {a: {cmd: 1}}\n", "schema: '2.0'\nstages:\n  a: {cmd: 1}\n"):
        assert splice(text, "b", "  b:\n    cmd: 2\n", ()) is None
