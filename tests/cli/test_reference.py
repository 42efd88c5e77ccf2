"""docs/params.md is what the models say."""

from pathlib import Path

from anyview.cli.reference import params_reference
from anyview.config import load_params

ROOT = Path(__file__).parents[2]


def test_the_params_reference_is_up_to_date():
    expected = params_reference(load_params(ROOT / "params.yaml"))
    written = (ROOT / "docs" / "params.md").read_text(encoding="utf-8")
    assert written == expected, "run `python -m anyview.cli.reference > docs/params.md`"


def test_every_scalar_of_params_yaml_is_explained():
    text = params_reference(load_params(ROOT / "params.yaml"))
    for key in ("base.seed", "assessment.shown", "imitation.ddpg.discount", "real.ingest.size"):
        row = next(line for line in text.splitlines() if line.startswith(f"| `{key}` |"))
        assert row.split("|")[4].strip(), key
