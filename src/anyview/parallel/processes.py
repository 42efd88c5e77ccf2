"""Stages as processes of this machine: forked from one that has imported DVC and read the graph."""

import gc
import multiprocessing
import os
import signal
import sys
from collections.abc import Mapping
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import TYPE_CHECKING

from anyview.parallel.graph import Node
from anyview.parallel.needs import Machine
from anyview.parallel.schedule import State
from anyview.parallel.stage import Order, Result, end_group, lead_group, perform, read_result, signal_group

if TYPE_CHECKING:
    from dvc.stage import Stage

_FORK = multiprocessing.get_context("fork")


class Processes:
    """Runs orders side by side on ``machine``. This process must have one thread, since it forks."""

    def __init__(self, machine: Machine, stages: "Mapping[str, Stage]"):
        self.machine, self._stages = machine, stages
        self.cores = self.largest = machine.cores
        self._lifeline = os.pipe()
        gc.freeze()  # what is here now is shared with every fork: a collection there would copy it
        self._running: dict[str, tuple[Node, tuple[str, ...], BaseProcess, Connection]] = {}

    def fits(self, node: Node) -> bool:
        """Whether there is room for ``node`` now."""
        return self.machine.fits(node.needs)

    def start(self, node: Node, order: Order) -> None:
        """Perform ``order`` in a new process; ``node`` tells what to keep free for it."""
        gpus = self.machine.take(node.needs)
        if gpus:
            order.environment["CUDA_VISIBLE_DEVICES"] = ",".join(gpus)
        receiver, sender = _FORK.Pipe(duplex=False)
        stage = self._stages[node.address]
        process = _FORK.Process(target=_perform, args=(stage, order, self._lifeline, sender))
        process.start()
        sender.close()
        self._running[node.address] = (node, gpus, process, receiver)

    def wait(self, seconds: float) -> list[Result]:
        """Results of stages that end within ``seconds``; returns at the first."""
        by_connection = {entry[3]: address for address, entry in self._running.items()}
        ended = wait(list(by_connection), timeout=seconds)
        return [self._end(by_connection[connection]) for connection in ended]  # type: ignore[index]

    def stop(self) -> None:
        """End all stages that run: SIGTERM, then SIGKILL for what stays."""
        for _, _, process, _ in self._running.values():
            signal_group(process.pid or 0, signal.SIGTERM)  # all at once, then each until it is gone
        for _, _, process, _ in self._running.values():
            end_group(process.pid or 0)
            process.join()
        self._running.clear()

    def _end(self, address: str) -> Result:
        node, gpus, process, receiver = self._running[address]
        try:
            result = read_result(receiver.recv_bytes())
        except EOFError:
            result = Result(address, State.FAILED, message="its DVC process was killed")
            end_group(process.pid or 0)
        process.join()
        receiver.close()
        del self._running[address]
        self.machine.give(node.needs, gpus)
        return result


def _perform(stage: "Stage", order: Order, lifeline: tuple[int, int], sender: Connection) -> None:
    os.close(lifeline[1])  # only the scheduler holds it, so that it closes with the scheduler
    sys.stdin = open(os.devnull)  # noqa: SIM115
    lead_group(order, lifeline[0])
    perform(stage, order, sender.send_bytes)
