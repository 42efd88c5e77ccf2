import shutil
import subprocess
from pathlib import Path

import pytest

from anyview.cli.profiles import active_profile, apply_profile, differences, profile_names, profile_values
from anyview.config import load_params
from anyview.runtime.errors import AnyviewError


@pytest.fixture
def params(root, tmp_path, monkeypatch) -> Path:
    """A copy of params.yaml beside the profiles, at profile `default`."""
    shutil.copytree(root / "profiles", tmp_path / "profiles")
    shutil.copy(root / "params.yaml", tmp_path)
    monkeypatch.chdir(tmp_path)
    apply_profile("default")
    return tmp_path / "params.yaml"


def test_the_profiles_that_there_are(params):
    assert profile_names() == ["default", "smoke", "study", "thesis"]


def test_default_holds_every_key_that_a_profile_sets_and_no_other():
    names = [name for name in profile_names() if name != "default"]
    default = profile_values("default")
    changed = {key for name in names for key, value in profile_values(name).items() if value != default[key]}
    assert changed == default.keys()


@pytest.mark.parametrize("name", ["default", "smoke", "study", "thesis"])
def test_each_profile_is_sound_and_known_again(params, name):
    apply_profile(name)
    load_params()
    assert active_profile() == name
    assert differences(name) == {}


def test_there_and_back_again_changes_no_byte(params):
    before = params.read_bytes()
    for name in ("smoke", "thesis", "study", "smoke", "default"):
        apply_profile(name)
    assert params.read_bytes() == before


def test_comments_and_other_values_stay(params):
    text = params.read_text().replace("seed: 42", "seed: 7 # mine")
    params.write_text(text)
    removed = apply_profile("smoke")
    assert "seed: 7 # mine" in params.read_text()
    assert [line for line in text.splitlines() if "#" in line] == [
        line for line in params.read_text().splitlines() if "#" in line
    ]
    assert removed["imitation.runs"] == (15, 2)


def test_a_changed_value_means_no_profile(params):
    params.write_text(params.read_text().replace("demos: 4000", "demos: 4001", 1))
    assert active_profile() is None
    assert differences("default") == {"simulate.sets.diverse.demos": (4001, 4000)}


def test_an_unknown_profile(params):
    with pytest.raises(AnyviewError, match="huge: no such profile; there are default, smoke, study, thesis"):
        apply_profile("huge")


@pytest.mark.parametrize(
    ("overlay", "said"),
    [
        ("imitation: {rums: 2}", "imitation.rums: not in default.yaml"),
        ("imitation: {runs: -2}", "imitation.runs: Input should be greater"),
        ("imitation: {runs: [", "not valid YAML"),
    ],
)
def test_a_wrong_profile_changes_nothing(params, overlay, said):
    before = params.read_bytes()
    (params.parent / "profiles" / "mine.yaml").write_text(overlay)
    with pytest.raises(AnyviewError, match=said):
        apply_profile("mine")
    assert params.read_bytes() == before


def test_the_committed_params_are_the_default_profiles(root, tmp_path):
    """Results in Git are the `default` profile's."""
    committed = subprocess.run(["git", "show", "HEAD:params.yaml"], cwd=root, capture_output=True, text=True)
    if committed.returncode:
        pytest.skip("not a clone")
    (tmp_path / "params.yaml").write_text(committed.stdout)
    assert differences("default", tmp_path / "params.yaml") == {}
