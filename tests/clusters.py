"""A Ray cluster on this machine, for tests that lose a part of it."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

_STORE = {"object_store_memory": 100_000_000}


@contextmanager
def two_nodes() -> Iterator[Any]:
    """Two nodes with one core each; the address is the first one's."""
    utils = pytest.importorskip("ray.cluster_utils")
    cluster = utils.Cluster(initialize_head=True, head_node_args={"num_cpus": 1, **_STORE})
    cluster.second = cluster.add_node(num_cpus=1, **_STORE)
    cluster.wait_for_nodes()
    yield cluster
    cluster.shutdown()
