"""The commands `anyview push` and `anyview pull`."""

import json
from contextlib import nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer


def push(
    repo: Annotated[str, typer.Argument(help="The model repository: USER/NAME.")],
    cell: Annotated[str, typer.Argument(help="An evaluated method, such as ours.")],
    licence: Annotated[str, typer.Option("--license", help="Of the weights, as the hub has it.")] = "mit",
    private: Annotated[bool, typer.Option("--private", help="If the repository is new, hide it.")] = False,
    dry: Annotated[
        Path | None, typer.Option("--dry", metavar="FOLDER", help="Upload nothing; make FOLDER to look at.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for a script.")] = False,
) -> None:
    """Upload a method's policies and the model of its reward, with a card, a rollout video and checksums.

    They replace what the repository has. No clips are uploaded. Log in by `hf auth login` or HF_TOKEN.
    """
    from anyview.analysis.study import read_method
    from anyview.runtime.outputs import whole_folder
    from anyview.sharing.card import write_card
    from anyview.sharing.checksums import find_policies, refuse_to_replace
    from anyview.sharing.folder import make_folder
    from anyview.sharing.hub import upload

    method = read_method(find_policies(cell))
    with nullcontext(str(dry)) if dry else TemporaryDirectory() as place:
        target = Path(place) if dry else Path(place) / "model"
        refuse_to_replace(target)
        with whole_folder(target) as folder:
            lock = make_folder(folder, cell, method.median_run)
            write_card(folder, repo, cell, method, lock, licence)
        address = None if dry else upload(repo, target, private)
    if as_json:
        print(json.dumps({"repo": repo, "folder": str(dry) if dry else None, "commit": address}))
        return
    print(f"{dry}: made, not uploaded" if dry else f"{repo}: {address}")


def pull(
    repo: Annotated[str, typer.Argument(help="A model repository of anyview push: USER/NAME.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FOLDER", help="Where to; by default NAME.")
    ] = None,
    revision: Annotated[
        str | None, typer.Option(help="A commit, branch or tag; by default the newest.", show_default=False)
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for a script.")] = False,
) -> None:
    """Download weights that somebody has pushed, and compare them with their checksums.

    `watch`, `export-policy` and `translate --model FOLDER/model` take the folder as they take a cell of your
    own. Nothing in it is code.
    """
    from anyview.sharing.hub import download

    folder = output or Path(repo.rpartition("/")[2])
    download(repo, folder, revision)
    if as_json:
        print(json.dumps({"repo": repo, "folder": str(folder)}))
        return
    print(f"{folder}: complete; `anyview watch {folder}` shows a policy")
