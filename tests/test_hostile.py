"""Mutated and forged files of every kind that the project reads, in processes of their own."""

import re
import subprocess
import sys


def test_hundreds_of_hostile_files_are_refused_or_harmless(root):
    """The benchmark with fewer files: no traceback, no hang, no code run, no stray write, little memory."""
    command = [sys.executable, "benchmarks/hostile.py", "--files", "255", "--seed", "2"]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    tried = re.search(r"^(\d+) files tried, 0 things amiss$", done.stdout, re.M)
    assert tried is not None
    assert int(tried.group(1)) >= 200
