import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

COMMANDS = ["repro", "doctor", "profile", "record", "clips", "export", "translate", "imitate"]
COMMANDS += ["watch", "export-policy", "push", "pull", "review", "sweep", "clean"]


@pytest.fixture
def here(root, tmp_path) -> Path:
    """A repository's params and profiles."""
    shutil.copytree(root / "profiles", tmp_path / "profiles")
    shutil.copy(root / "params.yaml", tmp_path)
    return tmp_path


def anyview(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "anyview", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        env={**os.environ, "NO_COLOR": "1", "TERM": "dumb", "COLUMNS": "200"},
    )


def test_help_lists_every_command(here):
    done = anyview(here, "--help")
    assert done.returncode == 0
    listed = [line.split()[1] for line in done.stdout.splitlines() if len(line.split()) > 2]
    assert [word for word in listed if word in COMMANDS] == COMMANDS


@pytest.mark.parametrize("command", COMMANDS)
def test_each_command_has_help(here, command):
    done = anyview(here, command, "--help")
    assert done.returncode == 0, done.stderr
    assert f"Usage: anyview {command}" in done.stdout


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("anyview rev", {"review"}),
        ("anyview review --", {"--to", "--images", "--json", "--help"}),
        ("anyview profile s", {"smoke", "study"}),
    ],
)
def test_the_shell_completes(here, typed, offered):
    """As bash asks: commands, their options, names of profiles."""
    last = str(len(typed.split()) - 1)
    asked = {"_ANYVIEW_COMPLETE": "complete_bash", "COMP_WORDS": typed, "COMP_CWORD": last}
    script = Path(sys.executable).parent / "anyview"
    done = subprocess.run([script], cwd=here, capture_output=True, text=True, env={**os.environ, **asked})
    assert set(done.stdout.split()) == offered


def test_no_command_waits_for_the_imports_of_another(here):
    script = (
        "import sys\n"
        "from anyview.cli.main import app\n"
        "for arguments in (['--help'], ['profile', '--help'], ['profile']):\n"
        "    try: app(arguments)\n"
        "    except SystemExit: pass\n"
        "heavy = {'torch', 'mujoco', 'cv2', 'pandas', 'dvc', 'matplotlib'} & sys.modules.keys()\n"
        "sys.exit(str(heavy) if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=here, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_profile_there_and_back(here):
    before = (here / "params.yaml").read_bytes()
    assert anyview(here, "profile", "default").returncode == 0
    changed = anyview(here, "profile", "smoke")
    assert (changed.returncode, changed.stderr) == (0, "")
    assert "imitation.runs: 15 -> 2" in changed.stdout
    assert anyview(here, "profile").stdout == "active profile: smoke\n"
    assert anyview(here, "profile", "smoke", "--check").returncode == 0
    assert anyview(here, "profile", "study", "--check").returncode == 1
    assert json.loads(anyview(here, "profile", "--json").stdout)["active"] == "smoke"
    assert "active" in json.loads(anyview(here, "profile", "default", "--json").stdout)
    assert (here / "params.yaml").read_bytes() == before


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["profile", "huge"], "error: huge: no such profile; there are default, smoke, study, thesis\n"),
        (["profile", "--chek"], "No such option: --chek"),
        (["profiel"], "No such command 'profiel'"),
        (["review", "no-such-revision"], "error: "),
    ],
)
def test_a_wrong_call_is_told_in_short(here, arguments, said):
    done = anyview(here, *arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert said in done.stderr
    assert "Traceback" not in done.stderr


def test_outside_of_a_repository(tmp_path):
    done = anyview(tmp_path, "profile", "smoke")
    assert done.returncode == 2
    assert done.stderr == "error: params.yaml: no such file; run from the root of the repository\n"


def test_doctor_finds_this_machine_fit(root):
    done = anyview(root, "doctor", "--json")
    checks = {check["name"]: check for check in json.loads(done.stdout)}
    assert checks.keys() >= {"python", "opengl", "device", "dvc", "cores", "profile", "disk", "scratch"}
    assert done.returncode == (0 if all(check["ok"] for check in checks.values()) else 1)
    assert checks["opengl"]["ok"]


def test_doctor_tells_what_is_missing(here):
    done = anyview(here, "doctor")
    assert done.returncode == 1
    assert "missing dvc" in done.stdout
    assert "-> run from the root of a clone of Anyview" in done.stdout


def test_clean_empties_the_scratch_folder(here, scratch):
    (scratch / "frames" / "abc").mkdir(parents=True)
    (scratch / "frames" / "abc" / "frames.npy").write_bytes(b"x" * 3_000_000)
    done = anyview(here, "clean")
    assert done.stdout == f"{scratch}: 3 MB freed\n"
    assert not (scratch / "frames").exists()
    assert json.loads(anyview(here, "clean", "--json").stdout) == {"scratch": str(scratch), "freed_bytes": 0}


def test_the_console_script_is_the_same_program(here):
    script = Path(sys.executable).parent / "anyview"
    assert subprocess.run([script, "profile", "--check"], cwd=here, capture_output=True).returncode in (0, 1)


def test_a_missing_dependency_is_told_in_one_line(here):
    """As where only some of the requirements are installed."""
    script = "import sys; sys.modules['cv2'] = None; from anyview.cli.main import main; main()"
    command = [sys.executable, "-c", script, "translate", "a.avi", "--context", "b.png", "--model", "sim"]
    done = subprocess.run(command, cwd=here, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.startswith("error: ")
    assert done.stderr.endswith("; run `make setup`\n")
    assert done.stderr.count("\n") == 1
    assert "cv2" in done.stderr
