"""Toy DVC repositories, as anybody might have them: shell commands that take a moment."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import psutil
from ruamel.yaml import YAML

DIAMOND = """
stages:
  start: {cmd: echo 1 > start, outs: [start]}
  middle:
    foreach: [left, right]
    do: {cmd: "sleep 0.2; cat start > ${item}", deps: [start], outs: ["${item}"]}
  end: {cmd: cat left right > end, deps: [left, right], outs: [end]}
  apart: {cmd: echo 2 > apart, outs: [apart]}
"""


class Toy:
    """A repository in ``folder`` with the pipeline ``text``."""

    def __init__(self, folder: Path, text: str):
        self.folder = folder
        folder.mkdir(parents=True)
        for command in (["git", "init", "-q"], ["dvc", "init", "-q"]):
            self.run(*command)
        (folder / "dvc.yaml").write_text(text)

    def copy(self, folder: Path) -> "Toy":
        """The same repository elsewhere."""
        shutil.copytree(self.folder, folder)
        other = object.__new__(Toy)
        other.folder = folder
        return other

    def start(
        self, *command: str, stdout: int = subprocess.PIPE, **environment: str
    ) -> subprocess.Popen[str]:
        """Start ``command`` in a session of its own."""
        path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
        return subprocess.Popen(
            [shutil.which(command[0], path=path) or command[0], *command[1:]],
            cwd=self.folder,
            env=os.environ | {"PATH": path, "SHELL": "/bin/sh", "DVC_NO_ANALYTICS": "1"} | environment,
            stdout=stdout,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )

    def run(self, *command: str, code: int = 0, **environment: str) -> str:
        """Run ``command``, which must end with ``code``; returns what it said."""
        process = self.start(*command, **environment)
        said, _ = process.communicate(timeout=120)
        assert process.returncode == code, said
        return said

    def lock(self) -> dict[str, Any]:
        """The stages of dvc.lock."""
        return YAML(typ="safe").load((self.folder / "dvc.lock").read_text())["stages"]

    def read(self, name: str) -> str:
        return (self.folder / name).read_text()

    def wait_for(self, name: str, process: subprocess.Popen[str]) -> None:
        """Wait until the file ``name`` is there, while ``process`` runs."""
        while not (self.folder / name).exists():
            assert process.poll() is None, process.communicate()
            time.sleep(0.02)

    def processes(self) -> list[str]:
        """Command lines of all processes at work in the repository."""
        found = []
        for process in psutil.process_iter(["cwd", "cmdline", "status"]):
            if process.info["cwd"] == str(self.folder) and process.info["status"] != psutil.STATUS_ZOMBIE:
                found.append(" ".join(process.info["cmdline"]))
        return found
