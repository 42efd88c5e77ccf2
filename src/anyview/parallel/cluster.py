"""Stages as tasks of a Ray cluster, which places them and tries again elsewhere when a node dies.

All nodes see the repository under the same path.
"""

import json
import os
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from anyview.parallel.graph import Node
from anyview.parallel.needs import Machine, Needs
from anyview.parallel.schedule import State
from anyview.parallel.stage import GRACE_SECONDS, Order, Result, read_result
from anyview.runtime.workers import RETRIES, connect_to_ray


class Cluster:
    """Runs orders as tasks with the resources that their stages state."""

    def __init__(self, jobs: int | None) -> None:
        """Of the cluster, stages use ``jobs`` cores together, or all of them."""
        self._ray = connect_to_ray()
        cores = [int(node["Resources"].get("CPU", 0)) for node in self._ray.nodes() if node["Alive"]]
        self.cores = jobs or sum(cores)
        self.largest = min(max(cores), self.cores)
        self._allowed = Machine(jobs or sys.maxsize)
        self._running: dict[Any, Node] = {}

    def fits(self, node: Node) -> bool:
        """Whether ``jobs`` allow ``node`` now. Ray keeps what it is given until a node has room."""
        return self._allowed.fits(Needs(node.needs.cores))

    def start(self, node: Node, order: Order) -> None:
        """Hand ``order`` to Ray."""
        needs = node.needs
        self._allowed.take(Needs(needs.cores))
        task = self._ray.remote(
            num_cpus=needs.cores, num_gpus=needs.gpus, memory=needs.memory or None, max_retries=RETRIES
        )(_perform)
        # Inside a stage, Ray would wait for cores that other stages hold.
        order.environment["ANYVIEW_BACKEND"] = "local"
        reference = task.options(name=node.address).remote(
            json.dumps(asdict(order)), os.getcwd(), dict(os.environ)
        )
        self._running[reference] = node

    def wait(self, seconds: float) -> list[Result]:
        """Results of stages that end within ``seconds``; returns at the first."""
        ended, _ = self._ray.wait(list(self._running), num_returns=1, timeout=seconds)
        return [self._end(reference) for reference in ended]

    def stop(self) -> None:
        """End all stages: as on SIGTERM, then with their tasks."""
        for reference in self._running:
            self._ray.cancel(reference)
        if self._running:
            count = len(self._running)
            self._ray.wait(list(self._running), num_returns=count, timeout=GRACE_SECONDS)
        for reference in self._running:
            self._ray.cancel(reference, force=True)
        self._running.clear()

    def _end(self, reference: Any) -> Result:
        node = self._running.pop(reference)
        self._allowed.give(Needs(node.needs.cores), ())
        try:
            return read_result(self._ray.get(reference))
        except self._ray.exceptions.RayError as error:
            return Result(node.address, State.FAILED, message=f"Ray: {str(error).strip().splitlines()[-1]}")


def _perform(order: str, folder: str, environment: dict[str, str]) -> bytes:
    """On a node: perform ``order`` in a process that ends with this one."""
    address = json.loads(order)["address"]
    if not Path(folder).is_dir():
        message = f"{folder}: a Ray node does not see it; keep the repository on shared storage"
        return json.dumps(asdict(Result(address, State.FAILED, message=message))).encode()
    # What Ray sets for this task, such as its GPUs, comes before what the shell has set.
    own = {name: value for name, value in os.environ.items() if name.startswith(("CUDA_", "RAY_"))}
    process = subprocess.Popen(
        [sys.executable, "-m", "anyview.parallel.stage", order],
        cwd=folder,
        env=environment | own,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        answer = process.stdout.read()
    finally:  # also when Ray cancels this task
        process.stdin.close()
        process.wait()
    lost = Result(address, State.FAILED, message="its DVC process ended without an answer")
    return answer or json.dumps(asdict(lost)).encode()
