"""The ``anyview`` command: its commands in the order of ``anyview --help``.

No module of a command imports anything heavy before the command runs, so that help and completion are fast.
"""

import json
from dataclasses import asdict
from importlib.metadata import version
from typing import Annotated, NoReturn

import typer
from rich.console import Console

from anyview.cli.clips import clips
from anyview.cli.export import export
from anyview.cli.export_policy import export_policy
from anyview.cli.imitate import imitate
from anyview.cli.record import record
from anyview.cli.repro import repro
from anyview.cli.review import review, sweep
from anyview.cli.sharing import pull, push
from anyview.cli.translate import translate
from anyview.cli.watch import watch
from anyview.runtime.errors import AnyviewError, exit_code

_EXTRAS = {"pyarrow": "lerobot", "huggingface_hub": "share", "onnx": "share", "onnxruntime": "share"}
_NOT_FIT = 1  # exit code: nothing was wrong with the input, but the answer is no

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(wanted: bool) -> None:
    if wanted:
        print(f"anyview {version('anyview')}")
        raise typer.Exit


@app.callback()
def _anyview(
    _version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Imitation of a task from a video filmed from any viewpoint.

    Run from the root of the repository. `anyview repro`, or `dvc repro`, runs the pipeline; the other
    commands help around it.

    Exit codes: 0 done, 1 the answer is no, 2 bad input, 130 interrupted.
    """


def doctor(as_json: Annotated[bool, typer.Option("--json", help="Print JSON for a script.")] = False) -> None:
    """Look whether this machine is fit for the active profile, and say what to do where it is not."""
    from anyview.cli.doctor import examine

    checks = examine()
    if as_json:
        print(json.dumps([asdict(check) | {"ok": not check.advice} for check in checks], indent=2))
    else:
        console = Console(highlight=False, soft_wrap=True)
        for check in checks:
            mark = "[red]missing[/red]" if check.advice else "[green]ok[/green]     "
            console.print(f"{mark} {check.name:8}", end=" ")
            console.print(check.found, markup=False)
            if check.advice:
                console.print(f"{'':16} -> {check.advice}", markup=False)
    if any(check.advice for check in checks):
        raise typer.Exit(_NOT_FIT)


def _names_of_profiles() -> list[str]:
    """For the shell's completion."""
    from anyview.cli.profiles import profile_names

    return profile_names()


def profile(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME", help="smoke, default, study, thesis.", autocompletion=_names_of_profiles
        ),
    ] = None,
    check: Annotated[
        bool, typer.Option("--check", help="Change nothing; exit 1 unless NAME, or any, is active.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for a script.")] = False,
) -> None:
    """Set params.yaml to the scale NAME, or without NAME say which one it has.

    Only the keys that profiles set are changed; comments and your other values stay.
    """
    from anyview.cli import profiles
    from anyview.config import load_params

    if name is None or check:
        load_params()
        active = profiles.active_profile()
        differing = profiles.differences(name or active or profiles.DEFAULT)
        if as_json:
            names = profiles.profile_names()
            print(json.dumps({"active": active, "profiles": names, "differences": differing}))
        else:
            print(f"active profile: {active or 'none'}")
            for key, (present, expected) in differing.items():
                print(f"  {key}: {present}, {name or profiles.DEFAULT} has {expected}")
        if check and (active is None or active != (name or active)):
            raise typer.Exit(_NOT_FIT)
        return
    changed = profiles.apply_profile(name)
    if as_json:
        print(json.dumps({"active": name, "changed": {key: new for key, (_, new) in changed.items()}}))
    else:
        for key, (old, new) in changed.items():
            print(f"{key}: {old} -> {new}")
        print(f"params.yaml has profile {name}; `dvc repro` runs what that changes")


def clean(as_json: Annotated[bool, typer.Option("--json", help="Print JSON for a script.")] = False) -> None:
    """Empty the scratch folder: checkpoints and decoded frames that no stage at work needs."""
    from anyview.runtime.scratch import clear_scratch, scratch_root

    folder, freed = scratch_root(), clear_scratch()
    if as_json:
        print(json.dumps({"scratch": str(folder), "freed_bytes": freed}))
    else:
        print(f"{folder}: {freed / 1e6:.0f} MB freed")


for command in (
    repro,
    doctor,
    profile,
    record,
    clips,
    export,
    translate,
    imitate,
    watch,
    export_policy,
    push,
    pull,
    review,
    sweep,
    clean,
):
    app.command()(command)


def main() -> NoReturn:
    """Entry point of the console script."""
    raise SystemExit(exit_code(_run))


def _run() -> None:
    try:
        app(prog_name="anyview")
    except ModuleNotFoundError as error:
        extra = _EXTRAS.get(error.name or "")
        advice = f"pip install 'anyview[{extra}]'" if extra else "run `make setup`"
        raise AnyviewError(f"{error}; {advice}") from None
    except SystemExit as ended:
        if ended.code:
            raise
