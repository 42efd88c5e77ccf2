import shutil
from pathlib import Path

import pytest

from anyview.cli import doctor
from anyview.cli.doctor import disk_needed, examine
from anyview.cli.profiles import apply_profile
from anyview.config import load_params


@pytest.fixture
def here(root, tmp_path, monkeypatch) -> Path:
    """A repository's params and profiles, without DVC or git."""
    shutil.copytree(root / "profiles", tmp_path / "profiles")
    shutil.copy(root / "params.yaml", tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def quick(monkeypatch) -> None:
    """Without the two looks that take a second each and have tests of their own."""
    monkeypatch.setattr(doctor, "_graphics", lambda: doctor.Check("opengl", "egl"))
    monkeypatch.setattr(doctor, "_device", lambda: doctor.Check("device", "cpu"))


def advice() -> dict[str, str]:
    return {check.name: check.advice for check in examine() if check.advice}


def test_what_is_missing_comes_with_advice(here, quick):
    assert advice() == {
        "dvc": "run from the root of a clone of Anyview",
        "git": "clone Anyview with git: DVC compares revisions",
    }


def test_a_path_in_which_dvcs_queue_fails_is_found(here, quick, monkeypatch):
    (here / ".dvc").mkdir()
    (here / ".dvc/config").touch()
    assert "dvc" not in advice()
    clone = here.rename(here.with_name("überblick"))
    monkeypatch.chdir(clone)
    assert "queue" in advice()["dvc"]


def test_room_is_measured_against_the_params(here, quick, monkeypatch):
    usage = shutil.disk_usage(here)
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: usage._replace(free=2_000_000_000))
    apply_profile("default")
    assert advice().keys() >= {"disk", "scratch"}
    apply_profile("smoke")
    assert not advice().keys() & {"disk", "scratch"}


def test_bigger_profiles_need_more(here):
    needs = []
    for name in ("smoke", "default", "thesis"):
        apply_profile(name)
        needs.append(sum(disk_needed(load_params())))
    assert needs == sorted(needs)
    assert needs[0] < 2e9 < needs[1] < 20e9


def test_unusable_params_are_a_finding_not_a_failure(here, quick):
    (here / "params.yaml").write_text("base: {seed: x}")
    assert advice()["params"].startswith("params.yaml: base.seed")


@pytest.mark.parametrize(
    ("name", "value", "check"), [("ANYVIEW_WORKERS", "0", "cores"), ("ANYVIEW_DEVICE", "gpu", "device")]
)
def test_impossible_settings_are_found(here, monkeypatch, name, value, check):
    monkeypatch.setenv(name, value)
    assert name in advice()[check]
