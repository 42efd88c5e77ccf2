"""The stages to reproduce, in the order of ``dvc repro``, each with what it waits for: by DVC itself."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from anyview.parallel.needs import Needs, read_needs
from anyview.runtime.errors import AnyviewError

if TYPE_CHECKING:
    from dvc.repo import Repo
    from dvc.stage import Stage


@dataclass(frozen=True)
class Node:
    """A stage, by the address that DVC gives it from here: what it waits for, and what it needs."""

    address: str
    upstream: frozenset[str]
    needs: Needs


Graph = dict[str, Node]


@contextmanager
def open_repository() -> "Iterator[Repo]":
    """The DVC repository that this folder is in. Raises AnyviewError for what DVC finds wrong with it."""
    from dvc.exceptions import DvcException
    from dvc.repo import Repo

    try:
        with Repo(_wait_for_lock=True) as repo:
            _keep_config(repo)
            yield repo
    except DvcException as error:
        raise AnyviewError(f"dvc: {error}") from None


def collect(repo: "Repo", targets: Sequence[str] = ()) -> "tuple[Graph, dict[str, Stage]]":
    """The graph of ``targets`` and of all that they depend on, and DVC's stages, both by address.

    Without targets, the stages of ./dvc.yaml. The order is that in which ``dvc repro`` would run them.
    """
    from dvc.dvcfile import PROJECT_FILE
    from dvc.repo import lock_repo
    from dvc.repo.reproduce import collect_stages, get_active_graph, plan_repro

    with lock_repo(repo):
        wanted = collect_stages(repo, targets or [PROJECT_FILE])
        active = get_active_graph(repo.index.graph)
        stages = {stage.addressing: stage for stage in plan_repro(active, wanted)}
        graph = {
            address: Node(
                address,
                frozenset(upstream.addressing for upstream in active.successors(stage)),
                read_needs(stage.meta, address),
            )
            for address, stage in stages.items()
        }
    return graph, stages


def on_cores(graph: Graph, cores: int) -> Graph:
    """``graph`` where a stage can have ``cores`` cores at most."""
    return {address: replace(node, needs=node.needs.on(cores)) for address, node in graph.items()}


def _keep_config(repo: "Repo") -> None:
    """Spare DVC reading its configuration again whenever it lets go of its lock: 40 ms a stage."""
    config, reset = repo.config, repo._reset

    def reset_but_config() -> None:
        reset()
        repo.__dict__["config"] = config

    repo._reset = reset_but_config
