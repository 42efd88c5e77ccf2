"""What `anyview repro` costs beside its stages: stand-ins that sleep, against plain `dvc repro`.

    python benchmarks/parallel.py [--stages 176] [--seconds 0.5] [--jobs 1 2 4 8 16]

Chains of stages in a toy repository sleep and write a line. Overhead is what a run takes beyond its stages'
sleep: in seconds of the clock beyond the sleep divided by the jobs, and in seconds of the processor, which
other work on the machine hardly changes. Both are given as fractions of the work, if each stage worked for
5.2 seconds, as those of the pipeline did for which Pivot states 1.6% for itself and 24.8% for DVC.
"""

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

CHAINS = 16
SECONDS = 5.2  # 1,214 s less 301 s of overhead, over 176 stages


def make(folder: Path, stages: int, seconds: float) -> None:
    """A DVC repository without Git, of ``stages`` stages in chains."""
    subprocess.run(["dvc", "init", "-q", "--no-scm"], cwd=folder, check=True)
    lines = ["stages:"]
    for index in range(stages):
        chain, place = index % CHAINS, index // CHAINS
        deps = f"[out-{chain}-{place - 1}]" if place else "[dvc.yaml.source]"
        lines.append(f"  s{chain}-{place}:\n    cmd: sleep {seconds}; echo {index} > out-{chain}-{place}")
        lines.append(f"    deps: {deps}\n    outs: [out-{chain}-{place}]")
    (folder / "dvc.yaml.source").touch()
    (folder / "dvc.yaml").write_text("\n".join(lines) + "\n")


def measure(stages: int, seconds: float, *command: str) -> tuple[float, float, bytes]:
    """Seconds of the clock and of the processor that ``command`` takes, and the lock that it leaves."""
    with tempfile.TemporaryDirectory() as name:
        make(Path(name), stages, seconds)
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        began = time.perf_counter()
        subprocess.run(command, cwd=name, check=True, stdout=subprocess.DEVNULL)
        clock = time.perf_counter() - began
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        lock = (Path(name) / "dvc.lock").read_bytes()
    return clock, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, lock


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--stages", type=int, default=176)
    parser.add_argument("--seconds", type=float, default=0.5)
    parser.add_argument("--jobs", type=int, nargs="+", default=[1, 2, 4, 8, 16])
    given = parser.parse_args()
    work = given.stages * SECONDS
    print(f"{given.stages} stages of {given.seconds} s; fractions of {work:.0f} s of work")
    print(f"{'':24} {'clock, s':>9} {'beyond, s':>10} {'of work':>8} {'processor, s':>13} {'of work':>8}")
    locks = set()
    ours = [sys.executable, "-m", "anyview", "repro"]
    ways = {"dvc repro": (1, ["dvc", "repro", "-q"])} | {
        f"anyview repro --jobs {jobs}": (jobs, [*ours, "--jobs", str(jobs)]) for jobs in given.jobs
    }
    for name, (jobs, command) in ways.items():
        clock, processor, lock = measure(given.stages, given.seconds, *command)
        beyond = clock - given.stages * given.seconds / min(jobs, CHAINS)
        cells = f"{clock:9.1f} {beyond:10.1f} {beyond / work:8.1%} {processor:13.1f} {processor / work:8.1%}"
        print(f"{name:24} {cells}", flush=True)
        locks.add(lock)
    print("all locks equal" if len(locks) == 1 else "LOCKS DIFFER")


if __name__ == "__main__":
    main()
