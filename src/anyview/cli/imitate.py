"""The command `anyview imitate`."""

import json
import sys
from contextlib import nullcontext, redirect_stdout
from pathlib import Path
from typing import Annotated

import typer


def imitate(
    clip: Annotated[str, typer.Argument(help="The expert's clip: any video, or the name of a set's clip.")],
    model: Annotated[
        str | None,
        typer.Option(
            "--model", help="A trained cell, or the folder of a model; without it the one that fits the clip."
        ),
    ] = None,
    context: Annotated[
        int | None,
        typer.Option(
            "--context", min=0, metavar="N", help="Act in this context of the evaluation, not in a fresh one."
        ),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the fresh context and of the training.")] = 0,
    episodes: Annotated[
        int,
        typer.Option("--episodes", min=1, max=100_000, help="How many to train for, of 49 steps each."),
    ] = 300,
    output: Annotated[Path, typer.Option("--output", "-o", help="The folder to write.")] = Path("imitated"),
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for a script.")] = False,
) -> None:
    """Train a policy to do what a clip shows, and film it.

    The clip is translated to the view of a simulated agent in another context, and DDPG is rewarded by it, as
    in the study. The folder holds the policy, its learning curve, and a video: the clip, its translation and
    the agent, side by side. An interrupted training goes on when the same command runs again.
    """
    from anyview.cli.imitation import prepare, train

    task = prepare(clip, model, context, seed, episodes, output)
    with redirect_stdout(sys.stderr) if as_json else nullcontext():
        outcome = train(task, output)
    if as_json:
        told = {"final_distance": outcome.distances, "shown": outcome.shown, "success": outcome.success}
        print(json.dumps({"output": str(output), "model": str(task.model), **told}))
    else:
        print(f"{output}: the agent leaves the object {outcome}")
