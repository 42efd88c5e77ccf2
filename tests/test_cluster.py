"""Beyond one machine: a Ray cluster that loses one of its two nodes, and storage shared by DVC remotes."""

import time
from collections.abc import Iterator
from urllib.request import Request, urlopen

import pytest

from tests.clusters import two_nodes
from tests.long_stages import LONG_STAGES, change, digests


@pytest.fixture(scope="module")
def cluster() -> Iterator:
    with two_nodes() as cluster:
        yield cluster


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ingest", "imitate"])
def test_a_cluster_makes_the_same_bytes(study, cluster, undisturbed, name):
    stage = LONG_STAGES[name]
    change(study.folder, stage.params)
    study.run("python", *stage.command, ANYVIEW_BACKEND="ray", RAY_ADDRESS=cluster.address)
    assert digests(study.folder / stage.output) == undisturbed(name)[0]


@pytest.mark.slow
def test_work_of_a_node_that_dies_is_done_by_the_other(study, cluster, undisturbed):
    stage = LONG_STAGES["simulate"]
    change(study.folder, stage.params)
    process = study.start("python", *stage.command, ANYVIEW_BACKEND="ray", RAY_ADDRESS=cluster.address)
    while len(list(study.scratch.rglob("shard-*.json"))) < 4:
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)
    cluster.remove_node(cluster.second, allow_graceful=False)
    said, complaint = process.communicate()
    assert process.returncode == 0, said + complaint
    assert digests(study.folder / stage.output) == undisturbed("simulate")[0]


@pytest.mark.slow
def test_a_cluster_that_is_not_there_is_told(study):
    command = LONG_STAGES["simulate"].command
    process = study.start("python", *command, ANYVIEW_BACKEND="ray", RAY_ADDRESS="127.0.0.1:1")
    _, complaint = process.communicate()
    assert process.returncode == 2
    assert complaint.strip().splitlines()[-1].startswith("error: RAY_ADDRESS=127.0.0.1:1: ")
    assert "Traceback" not in complaint


@pytest.fixture
def bucket(monkeypatch) -> Iterator[tuple[str, str]]:
    """A bucket of an S3-compatible server on this machine: (its URL, the server's address)."""
    pytest.importorskip("dvc_s3")
    server = pytest.importorskip("moto.server").ThreadedMotoServer("127.0.0.1", port=0, verbose=False)
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "test")
    monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
    server.start()
    address = "http://{}:{}".format(*server.get_host_and_port())
    urlopen(Request(f"{address}/anyview", method="PUT")).close()
    yield "s3://anyview/cache", address
    server.stop()


@pytest.mark.slow
def test_results_travel_through_an_s3_bucket(study, tmp_path, bucket):
    url, address = bucket
    study.run("dvc", "remote", "add", "--default", "shared", url)
    study.run("dvc", "remote", "modify", "shared", "endpointurl", address)
    study.run("dvc", "push", "--with-deps", "imitate@ours")
    other = study.clone(tmp_path / "clone")
    other.run("dvc", "pull", "--with-deps", "imitate@ours")
    for folder in ("clips/diverse", "models/sim", "policies/ours"):
        assert digests(other.folder / "data" / folder) == digests(study.folder / "data" / folder) != {}
    assert "up to date" in other.run("dvc", "repro", "imitate@ours")
