"""The Slurm script of docs/scaling.md on two nodes of this machine, with stand-ins for Slurm's commands."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.parallel.toys import DIAMOND, Toy

pytest.importorskip("ray")

SCONTROL = """#!/bin/sh
printf '10.77.0.1\\n10.77.0.2\\n'
"""
# Ray takes a machine for one node, and stops all of Ray that it finds there. So a node has processes, network
# and /tmp/ray of its own; a cable joins the two.
SRUN = """#!/bin/bash
set -e
nodes=(anyview-$$-1 anyview-$$-2)
trap 'ip netns del ${nodes[0]}; ip netns del ${nodes[1]}' EXIT
for node in ${nodes[@]}; do ip netns add $node; ip -n $node link set lo up; done
ip link add eth0 netns ${nodes[0]} type veth peer name eth0 netns ${nodes[1]}
mkdir -p /tmp/ray
for index in 0 1; do
    ip -n ${nodes[index]} addr add 10.77.0.$((index + 1))/24 dev eth0
    ip -n ${nodes[index]} link set eth0 up
    ip netns exec ${nodes[index]} unshare --pid --fork --kill-child --mount --mount-proc \\
        sh -c 'mount -t tmpfs none /tmp/ray && "$@"; exit $?' sh "$@" &
done
wait -n && wait
"""
# The two in the middle wait for each other, and say on which node they are.
MEETING = DIAMOND.replace(
    "sleep 0.2;",
    "hostname -I > node-${item}; until [ -s node-left ] && [ -s node-right ]; do sleep 0.1; done;",
)


def has_namespaces() -> bool:
    """Whether this user may make nodes."""
    made = ["unshare", "--net", "--pid", "--fork", "--mount-proc", "ip", "link", "add", "type", "veth"]
    try:
        return subprocess.run(made, capture_output=True).returncode == 0
    except FileNotFoundError:
        return False


@pytest.mark.slow
@pytest.mark.skipif(not has_namespaces(), reason="needs root to make two nodes of one machine")
def test_the_recipe_runs_stages_on_both_nodes(root: Path, tmp_path):
    (recipe,) = re.findall(r"^```bash\n(#!.*?)^```", (root / "docs/scaling.md").read_text(), re.M | re.S)
    toy = Toy(tmp_path / "toy", MEETING)
    (toy.folder / "job.sh").write_text(recipe)
    commands = tmp_path / "slurm"
    for path, text in (
        (toy.folder / ".venv" / "bin" / "activate", f'PATH="{Path(sys.executable).parent}:$PATH"\n'),
        (commands / "scontrol", SCONTROL),
        (commands / "srun", SRUN),
    ):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        path.chmod(0o755)
    slurm = {
        "SLURM_JOB_NODELIST": "10.77.0.[1-2]",
        "SLURM_JOB_NUM_NODES": "2",
        "SLURM_CPUS_PER_TASK": "1",
        "PATH": f"{commands}:{os.environ['PATH']}",
        "RAY_SYMMETRIC_RUN_CLUSTER_WAIT_TIMEOUT": "120",
    }
    process = toy.start("bash", "job.sh", **slurm)
    said, _ = process.communicate(timeout=400)
    assert "5 ran" in said, said
    assert {toy.read("node-left"), toy.read("node-right")} == {"10.77.0.1 \n", "10.77.0.2 \n"}
    assert "Data and pipelines are up to date." in toy.run("dvc", "repro")
