"""Beyond one machine: a Ray cluster that loses one of its two nodes, and storage shared by DVC remotes."""

import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.conftest import Study
from tests.test_resume import CASES, change, digests

STORE = {"object_store_memory": 100_000_000}


@pytest.fixture
def cluster() -> Iterator:
    """Two nodes with one core each; the address is the first one's."""
    utils = pytest.importorskip("ray.cluster_utils")
    cluster = utils.Cluster(initialize_head=True, head_node_args={"num_cpus": 1, **STORE})
    cluster.second = cluster.add_node(num_cpus=1, **STORE)
    cluster.wait_for_nodes()
    yield cluster
    cluster.shutdown()


@pytest.fixture
def study(smoke, tmp_path) -> Study:
    """A copy of the smoke study, with an empty scratch folder."""
    folder = tmp_path / "study"
    shutil.copytree(smoke.folder, folder, ignore=shutil.ignore_patterns(".venv", "tmp"))
    return Study(folder, tmp_path / "scratch")


@pytest.mark.slow
def test_work_of_a_node_that_dies_is_done_by_the_other(study, cluster):
    command, output, params = CASES["simulate"]
    change(study, **params)
    study.run("python", *command)
    expected = digests(study.folder / output)
    shutil.rmtree(study.folder / output)
    shutil.rmtree(study.scratch)

    process = study.start("python", *command, ANYVIEW_BACKEND="ray", RAY_ADDRESS=cluster.address)
    while len(list(study.scratch.rglob("shard-*.json"))) < 4:
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)
    cluster.remove_node(cluster.second, allow_graceful=False)
    said, complaint = process.communicate()
    assert process.returncode == 0, said + complaint
    assert digests(study.folder / output) == expected


@pytest.mark.slow
@pytest.mark.parametrize("case", ["ingest", "imitate"])
def test_a_cluster_makes_the_same_bytes(study, cluster, case):
    command, output, params = CASES[case]
    change(study, **params)
    found = []
    for environment in ({}, {"ANYVIEW_BACKEND": "ray", "RAY_ADDRESS": cluster.address}):
        study.run("python", *command, **environment)
        found.append(digests(study.folder / output))
        shutil.rmtree(study.folder / output)
        shutil.rmtree(study.scratch)
    assert found[0] == found[1]


@pytest.mark.slow
def test_a_cluster_that_is_not_there_is_told(study):
    command, _, _ = CASES["simulate"]
    process = study.start("python", *command, ANYVIEW_BACKEND="ray", RAY_ADDRESS="127.0.0.1:1")
    _, complaint = process.communicate()
    assert process.returncode == 2
    assert complaint.strip().splitlines()[-1].startswith("error: RAY_ADDRESS=127.0.0.1:1: ")
    assert "Traceback" not in complaint


def clone(study: Study, folder: Path) -> Study:
    """A second machine: what Git has, an empty DVC cache, an empty scratch folder."""
    study.run("git", "add", "-A")
    study.run("git", "-c", "user.name=a", "-c", "user.email=a@example.org", "commit", "-q", "-m", "results")
    study.run("git", "clone", "-q", str(study.folder), str(folder))
    return Study(folder, folder.with_name("other-scratch"))


def test_results_travel_through_a_shared_folder(study, tmp_path):
    """``dvc push`` here, ``dvc pull`` there: the same bytes, and nothing to run again."""
    study.run("dvc", "remote", "add", "--default", "shared", str(tmp_path / "remote"))
    study.run("dvc", "push")
    other = clone(study, tmp_path / "clone")
    other.run("dvc", "pull")
    assert digests(other.folder / "data") == digests(study.folder / "data")
    assert "up to date" in other.run("dvc", "repro")


def test_another_clone_can_use_the_run_cache(study, tmp_path):
    """Without the lock file: ``dvc repro`` recognises what somebody else has run, and fetches it."""
    study.run("dvc", "remote", "add", "--default", "shared", str(tmp_path / "remote"))
    study.run("dvc", "push", "--run-cache")
    other = clone(study, tmp_path / "clone")
    (other.folder / "dvc.lock").unlink()
    other.run("dvc", "pull", "--run-cache", "--allow-missing")
    said = other.run("dvc", "repro", "--pull", "simulate@narrow")
    assert "Stage 'simulate@narrow' is cached" in said
