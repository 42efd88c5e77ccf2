"""`anyview export-policy`, `push` and `pull` as users run them, with a hub on this machine."""

import hashlib
import json
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

from anyview.learners.common.policies import load_policy
from anyview.video.files import read_video
from tests.conftest import Study
from tests.sharing.hub import TOKEN, Hub, running_hub

onnxruntime = pytest.importorskip("onnxruntime")
pytest.importorskip("huggingface_hub")
REPO = "lab/pusher-ours"


@pytest.fixture(scope="module")
def lab(trunk: Study, tmp_path_factory) -> Study:
    """A study with the policies of `ours`."""
    return trunk.copy(tmp_path_factory.mktemp("lab"))


@pytest.fixture(scope="module")
def hub() -> Iterator[Hub]:
    with running_hub() as hub:
        yield hub


@pytest.fixture(scope="module")
def environment(hub: Hub, tmp_path_factory) -> dict[str, str]:
    """Without Xet, a storage service that the hub here does not have: files go by Git LFS then."""
    return {
        "HF_ENDPOINT": hub.address,
        "HF_TOKEN": TOKEN,
        "HF_HOME": str(tmp_path_factory.mktemp("hf")),
        "HF_HUB_DISABLE_XET": "1",
    }


@pytest.fixture(scope="module")
def pushed(lab: Study, hub: Hub, environment) -> dict[str, bytes]:
    """What the hub has after `anyview push`, twice: the second time with a file of somebody else's there."""
    lab.run("anyview", "push", REPO, "ours", **environment)
    hub.files(REPO)["policies/policy-99.safetensors"] = b"old"
    told = json.loads(lab.run("anyview", "push", REPO, "ours", "--json", **environment))
    assert told["commit"].startswith(f"{hub.address}/{REPO}/commit/")
    return hub.files(REPO)


def refused(study: Study, *command: str, **environment: str) -> str:
    """The one line that ``command`` says of bad input."""
    process = study.start("anyview", *command, **environment)
    said, complaint = process.communicate()
    assert process.returncode == 2, said + complaint
    assert complaint.splitlines()[-1].startswith("error: ")
    assert "Traceback" not in complaint
    return complaint.splitlines()[-1]


def test_a_policy_as_an_onnx_file(lab: Study):
    told = json.loads(lab.run("anyview", "export-policy", "ours", "--run", "1", "--json"))
    assert told["difference"] < 1e-5
    session = onnxruntime.InferenceSession(lab.folder / "policy.onnx", providers=["CPUExecutionProvider"])
    observations = np.random.default_rng(0).uniform(-1, 1, (20, 15)).astype(np.float32)
    (actions,) = session.run(["action"], {"observation": observations})
    policy = load_policy(lab.folder / "data/policies/ours", 1)
    np.testing.assert_allclose(actions, [policy.act(each) for each in observations], atol=1e-5)
    assert "there are runs 0 to 1" in refused(lab, "export-policy", "ours", "--run", "2")
    assert "must end in .onnx" in refused(lab, "export-policy", "ours", "-o", "policy.pt")
    assert "theirs: no such method" in refused(lab, "export-policy", "theirs")


def test_what_is_pushed(lab: Study, pushed: dict[str, bytes]):
    """Weights as they are, checksums of all, no clip, and nothing of what was there before."""
    for name in ("policy.json", "policy-0.safetensors", "policy-1.safetensors", "runs.csv"):
        assert pushed[f"policies/{name}"] == (lab.folder / "data/policies/ours" / name).read_bytes()
    assert (
        pushed["model/weights.safetensors"]
        == (lab.folder / "data/models/sim/weights.safetensors").read_bytes()
    )
    listed = dict(reversed(line.split("  ")) for line in pushed["SHA256SUMS"].decode().splitlines())
    assert listed == {
        name: hashlib.sha256(content).hexdigest()
        for name, content in pushed.items()
        if name not in ("README.md", "SHA256SUMS")
    }
    kinds = {Path(name).suffix for name in pushed}
    assert kinds == {".safetensors", ".json", ".csv", ".md", ".yaml", ".mp4", ""}
    provenance = YAML(typ="safe").load(pushed["provenance.yaml"])
    assert set(provenance) == {"imitate@ours", "train@sim", "split@diverse", "simulate@diverse"}


def test_the_card_says_what_scale_and_how_good(lab: Study, pushed: dict[str, bytes]):
    _, front, text = pushed["README.md"].decode().split("---\n", 2)
    data = YAML(typ="safe").load(front)
    assert data["license"] == "mit"
    (entry,) = data["model-index"]
    metrics = {each["type"]: each["value"] for each in entry["results"][0]["metrics"]}
    runs = [line.split(",") for line in pushed["policies/runs.csv"].decode().splitlines()]
    distances = [float(row[runs[0].index("final_distance")]) for row in runs[1:]]
    assert metrics["median final distance, cm"] == pytest.approx(100 * np.median(distances), abs=1e-3)
    assert "| `imitation.runs` | 2 |" in text
    assert "| `simulate.sets.diverse.demos` | 24 |" in text
    assert f"anyview pull {REPO}" in text
    assert '<video controls loop src="rollout.mp4">' in text


@pytest.mark.slow
def test_a_stranger_pulls_watches_and_exports(lab: Study, pushed, environment, tmp_path):
    other = Study(tmp_path, tmp_path / "scratch")
    (tmp_path / "src").symlink_to(lab.folder / "src")
    anonymous = environment | {"HF_TOKEN": ""}
    other.run("anyview", "pull", REPO, **anonymous)
    folder = tmp_path / "pusher-ours"
    files = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    assert files == set(pushed)
    subprocess.run(["sha256sum", "--check", "--quiet", "SHA256SUMS"], cwd=folder, check=True)
    assert read_video(folder / "rollout.mp4").shape == (50, 256, 256, 3)
    assert "cm from the goal" in other.run("anyview", "watch", "pusher-ours", "--size", "64")
    other.run("anyview", "export-policy", "pusher-ours", "-o", "theirs.onnx")
    lab.run("anyview", "export-policy", "ours", "-o", "ours.onnx")
    assert (tmp_path / "theirs.onnx").read_bytes() == (lab.folder / "ours.onnx").read_bytes()
    translate = ("translate", "pusher-ours/rollout.mp4", "--context", "pusher-ours/rollout.mp4")
    other.run("anyview", *translate, "--model", "pusher-ours/model")

    (folder / "README.md").write_text("a better card")
    (folder / "model" / "weights.safetensors").write_bytes(b"worse weights")
    complaint = "pusher-ours/model/weights.safetensors: damaged, not the file of SHA256SUMS"
    assert complaint in refused(other, "watch", "pusher-ours")
    assert complaint in refused(other, *translate, "--model", "pusher-ours/model")
    other.run("anyview", "pull", REPO, **anonymous)  # again: what is damaged is replaced
    other.run("anyview", "export-policy", "pusher-ours")
    (folder / "policies" / "policy-7.safetensors").write_bytes(b"more weights")
    assert "policy-7.safetensors: not in SHA256SUMS" in refused(other, "export-policy", "pusher-ours")


@pytest.mark.slow
def test_what_came_damaged_or_from_elsewhere_is_not_kept(lab: Study, hub: Hub, pushed, environment, tmp_path):
    other = Study(tmp_path, tmp_path / "scratch")
    (tmp_path / "src").symlink_to(lab.folder / "src")
    hub.repos["lab/damaged"] = [dict(pushed) | {"policies/policy-0.safetensors": b"other weights"}]
    hub.repos["lab/pickles"] = [{"README.md": b"", "model.pkl": b"code"}]
    hub.repos["lab/src"] = [dict(pushed)]
    assert "policy-0.safetensors: damaged" in refused(other, "pull", "lab/damaged", **environment)
    assert "lab/pickles: no model of `anyview push`" in refused(other, "pull", "lab/pickles", **environment)
    assert "src: is there already, and no model folder" in refused(other, "pull", "lab/src", **environment)
    assert "lab/none: 404" in refused(other, "pull", "lab/none", **environment)
    nowhere = environment | {"HF_ENDPOINT": "http://127.0.0.1:9"}
    assert "lab/none: " in refused(other, "pull", "lab/none", **nowhere)
    assert [path.name for path in tmp_path.iterdir() if path.name not in ("src", "scratch")] == []


@pytest.mark.slow
def test_a_push_that_cannot_be_is_told(lab: Study, hub: Hub, environment, tmp_path):
    study = lab.copy(tmp_path)
    stranger = environment | {"HF_TOKEN": "hf_wrong"}
    assert "Invalid username or password." in refused(study, "push", "lab/new", "ours", **stranger)
    assert "lab/new" not in hub.repos
    study.run("anyview", "push", "lab/new", "ours", "--license", "cc-by-4.0", "--dry", "look", **environment)
    assert "license: cc-by-4.0" in (study.folder / "look" / "README.md").read_text()
    assert "lab/new" not in hub.repos
    shutil.copy(study.folder / "data/policies/ours/policy-0.safetensors", study.folder / "policy")
    (study.folder / "data/policies/ours/policy-1.safetensors").unlink()
    (study.folder / "policy").rename(study.folder / "data/policies/ours/policy-1.safetensors")
    said = refused(study, "push", "lab/new", "ours", **environment)
    assert "data/policies/ours: not what dvc.lock describes; run `dvc repro` or `dvc checkout` first" in said
