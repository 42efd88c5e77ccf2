"""The ``anyview`` command."""

import json
from collections.abc import Callable
from dataclasses import asdict
from importlib import import_module
from importlib.metadata import version
from typing import Annotated, Any, NoReturn

import typer
from rich.console import Console
from typer.core import TyperCommand, TyperGroup

from anyview.runtime.errors import AnyviewError, exit_code

_NOT_FIT = 1  # exit code: nothing was wrong with the input, but the answer is no

# The commands of the other packages: where they are, and the line that stands for them in `anyview --help`,
# so that no command has to wait for the imports of another.
_ELSEWHERE = {
    "record": ("anyview.cli.clips", "Film one demonstration with one or two webcams at once."),
    "clips": (
        "anyview.cli.clips",
        "List the clips that there are, by kind, split and source, and the refused with the reason.",
    ),
    "translate": ("anyview.cli.translate", "Translate a clip to another viewpoint."),
    "watch": ("anyview.cli.watch", "Watch a trained policy act, seen from its own camera."),
    "review": (
        "anyview.cli.review",
        "Summarise what changed since REV: params, metrics beyond their intervals, strips, stages rerun.",
    ),
    "sweep": (
        "anyview.cli.review",
        "Draw what a sweep of KEY by `dvc exp` did to the metrics, as one picture and one table.",
    ),
}


class _Elsewhere(TyperCommand):
    """A command whose module is imported when it is called."""

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        assert self.name is not None
        return _load(self.name).make_context(info_name, args, parent=parent, **extra)


class _Commands(TyperGroup):
    """The commands of this module and, in a fixed order, those from elsewhere."""

    def list_commands(self, ctx: Any) -> list[str]:
        here = super().list_commands(ctx)
        return [*(name for name in here if name != "clean"), *_ELSEWHERE, "clean"]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name in _ELSEWHERE:
            return _Elsewhere(cmd_name, help=_ELSEWHERE[cmd_name][1], callback=lambda: None)
        return super().get_command(ctx, cmd_name)


app = typer.Typer(
    cls=_Commands,
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

    Run from the root of the repository. `dvc repro` runs the pipeline; these commands help around it.

    Exit codes: 0 done, 1 the answer is no, 2 bad input, 130 interrupted.
    """


@app.command()
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


@app.command()
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


@app.command()
def clean(as_json: Annotated[bool, typer.Option("--json", help="Print JSON for a script.")] = False) -> None:
    """Empty the scratch folder: checkpoints and decoded frames that no stage at work needs."""
    from anyview.runtime.scratch import clear_scratch, scratch_root

    folder, freed = scratch_root(), clear_scratch()
    if as_json:
        print(json.dumps({"scratch": str(folder), "freed_bytes": freed}))
    else:
        print(f"{folder}: {freed / 1e6:.0f} MB freed")


def _load(name: str) -> Any:
    """The real command ``name`` of another package: the function of that name in its module, or a group."""
    found: Callable[..., Any] | typer.Typer
    try:
        found = getattr(import_module(_ELSEWHERE[name][0]), name)
    except ModuleNotFoundError as error:
        raise AnyviewError(f"{name}: {error}; run `make setup`") from None
    if isinstance(found, typer.Typer):
        return typer.main.get_group(found)
    alone = typer.Typer(add_completion=False, context_settings={"help_option_names": ["-h", "--help"]})
    alone.command(name)(found)
    return typer.main.get_command(alone)


def main() -> NoReturn:
    """Entry point of the console script."""
    raise SystemExit(exit_code(_run))


def _run() -> None:
    try:
        app(prog_name="anyview")
    except SystemExit as ended:
        if ended.code:
            raise
