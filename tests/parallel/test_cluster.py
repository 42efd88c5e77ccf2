"""`anyview repro` on a Ray cluster of two nodes on this machine."""

import time
from collections.abc import Iterator

import pytest

from tests.clusters import two_nodes
from tests.conftest import Study
from tests.long_stages import digests
from tests.parallel.toys import DIAMOND, Toy


@pytest.fixture
def cluster() -> Iterator:
    with two_nodes() as cluster:
        yield cluster


@pytest.mark.slow
def test_a_cluster_makes_the_lock_of_dvc_repro(tmp_path, cluster):
    """Two stages meet on the two nodes; then one node dies under a stage, which runs on the other."""
    backend = {"ANYVIEW_BACKEND": "ray", "RAY_ADDRESS": cluster.address}
    plain = Toy(tmp_path / "plain", DIAMOND)
    toy = plain.copy(tmp_path / "toy")
    plain.run("dvc", "repro", "-q")
    assert "5 ran" in toy.run("anyview", "repro", **backend)
    assert toy.read("dvc.lock") == plain.read("dvc.lock")

    text = DIAMOND.replace("sleep 0.2;", "echo $PPID > here-${item}; until [ -e go ]; do sleep 0.05; done;")
    (toy.folder / "dvc.yaml").write_text(text)
    process = toy.start("anyview", "repro", **backend)
    toy.wait_for("here-left", process)
    toy.wait_for("here-right", process)
    cluster.remove_node(cluster.second, allow_graceful=False)
    time.sleep(1)
    (toy.folder / "go").touch()
    said, _ = process.communicate(timeout=180)
    assert process.returncode == 0, said
    assert "Data and pipelines are up to date." in toy.run("dvc", "repro")


@pytest.mark.slow
def test_a_cluster_makes_the_smoke_profile_of_dvc_repro(trunk: Study, smoke: Study, tmp_path, cluster):
    """On nodes of one core, although stages can use more."""
    study = trunk.copy(tmp_path)
    study.run("anyview", "repro", ANYVIEW_BACKEND="ray", RAY_ADDRESS=cluster.address)
    assert (study.folder / "dvc.lock").read_bytes() == (smoke.folder / "dvc.lock").read_bytes()
    assert digests(study.folder / "metrics") == digests(smoke.folder / "metrics")
    assert "up to date" in study.run("dvc", "repro")
