"""The command `anyview export-policy`."""

import json
from pathlib import Path
from typing import Annotated

import typer

from anyview.runtime.errors import AnyviewError


def export_policy(
    cell: Annotated[str, typer.Argument(help="An evaluated method, such as ours, or a model folder.")],
    run: Annotated[int, typer.Option("--run", min=0, help="Which of its runs.")] = 0,
    output: Annotated[Path, typer.Option("--output", "-o", help="The ONNX file.")] = Path("policy.onnx"),
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for a script.")] = False,
) -> None:
    """Write a trained policy as an ONNX file, for any program with an ONNX runtime.

    Its input is `observation` (N, 15), its output `action` (N, 3) in [-1, 1]. The file is checked first: over
    an episode in its own context, onnxruntime has to act as the policy does.
    """
    import numpy as np

    from anyview.learners.common.policies import load_policy
    from anyview.pusher.batch import PusherBatch
    from anyview.pusher.episodes import episode
    from anyview.runtime.outputs import write_atomically
    from anyview.sharing.checksums import find_policies
    from anyview.sharing.onnx_policy import check_actions, to_onnx

    if output.suffix != ".onnx":
        raise AnyviewError(f"{output}: the output must end in .onnx")
    policy = load_policy(find_policies(cell), run)
    pusher = PusherBatch([policy.context], policy.control)
    moments = episode(pusher, lambda now: policy.act(now.observations[0])[None])
    observations = np.concatenate([now.observations for now in moments])
    model = to_onnx(policy, observations.shape[1])
    difference = check_actions(model, policy, observations)
    write_atomically(output, model)
    if as_json:
        print(json.dumps({"output": str(output), "difference": difference}))
        return
    print(f"{output}: {cell} run {run}; onnxruntime acts as the policy does, within {difference:.1g}")
