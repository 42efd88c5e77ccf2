"""What stands around the code: locks, Makefile, workflows, hooks."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from anyview.config import read_yaml

ROOT = Path(__file__).parents[1]
BIN = Path(sys.executable).parent
WORKFLOW = read_yaml(ROOT / ".github" / "workflows" / "ci.yml")


def test_the_locks_hold_hashes_and_no_addresses():
    for name in ("requirements.lock", "requirements-dev.lock"):
        text = (ROOT / name).read_text()
        pins = re.findall(r"^([\w.-]+)==\S+ \\\n((?:    --hash=sha256:[0-9a-f]{64}(?: \\)?\n)+)", text, re.M)
        assert len(pins) == len(re.findall(r"^[\w.-]+[=<>@ ]", text, re.M)) > 100
        assert "://" not in text
        assert not re.search(r"^(torch|nvidia|triton)", text, re.M)


def test_the_lock_for_users_is_part_of_the_one_for_developers():
    pins = [
        set(re.findall(r"^[\w.-]+==\S+", (ROOT / name).read_text(), re.M))
        for name in ("requirements.lock", "requirements-dev.lock")
    ]
    assert pins[0] <= pins[1]


@pytest.mark.parametrize(
    ("schema", "path"),
    [("workflows", ".github/workflows/ci.yml"), ("actions", ".github/actions/prepare/action.yml")],
)
def test_github_understands_our_files(schema, path):
    command = [BIN / "check-jsonschema", "--builtin-schema", f"vendor.github-{schema}", path]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_hooks_are_sound():
    done = subprocess.run([BIN / "pre-commit", "validate-config"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    for hook in read_yaml(ROOT / ".pre-commit-config.yaml")["repos"][0]["hooks"]:
        assert (BIN / Path(hook["entry"].split()[0]).name).is_file(), hook["id"]


def test_make_help_lists_the_targets():
    done = subprocess.run(["make", "help"], cwd=ROOT, capture_output=True, text=True, check=True)
    listed = {line.split()[1] for line in done.stdout.splitlines()}
    assert listed >= {
        "repro",
        "test",
        "test-slow",
        "lint",
        "bench",
        "clean",
        "lock",
        "audit",
        "setup",
        "help",
    }


def make_targets(script: str) -> list[str]:
    return re.findall(r"^\s*make ([\w-]+)", script, re.M)


def steps(job: str) -> list[str]:
    return [step["run"] for step in WORKFLOW["jobs"][job]["steps"] if "run" in step]


def test_the_workflow_and_ci_run_the_same_targets():
    script = (ROOT / ".ci" / "run").read_text()
    assert make_targets(script) == make_targets("\n".join(steps("test"))) == ["test", "test-slow"]
    for target in ("test", "test-slow", "setup-dev"):
        subprocess.run(["make", "-n", target], cwd=ROOT, check=True, capture_output=True)


def test_the_same_opengl_packages_everywhere():
    named = {
        path: re.findall(
            r"\blib\w+(?:-\w+)*", next(line for line in (ROOT / path).open() if "libosmesa6" in line)
        )
        for path in ("Makefile", "src/anyview/runtime/graphics.py", ".github/actions/prepare/action.yml")
    }
    assert len({tuple(packages) for packages in named.values()}) == 1
