"""The command `anyview watch`."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from anyview.video.files import Codec

CODECS: dict[str, "Codec"] = {".mp4": "XVID", ".avi": "FFV1"}


def watch(
    cell: Annotated[str, typer.Argument(help="An evaluated method, such as ours, or a model folder.")],
    run: Annotated[int, typer.Option("--run", min=0, help="Which of its runs.")] = 0,
    output: Annotated[Path, typer.Option("--output", "-o", help="The video, .mp4 or .avi.")] = Path(
        "watch.mp4"
    ),
    size: Annotated[int, typer.Option("--size", min=64, max=1024, help="Width and height in pixels.")] = 512,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for a script.")] = False,
) -> None:
    """Watch a trained policy act, seen from its own camera."""
    from anyview.learners.common.policies import load_policy
    from anyview.pusher.batch import PusherBatch
    from anyview.pusher.episodes import film
    from anyview.runtime.errors import AnyviewError
    from anyview.sharing.checksums import find_policies
    from anyview.video.files import write_video

    if output.suffix not in CODECS:
        raise AnyviewError(f"{output}: the output must end in {' or '.join(CODECS)}")
    if size % 2:
        raise AnyviewError(f"--size {size}: must be even")
    policy = load_policy(find_policies(cell), run)
    pusher = PusherBatch([policy.context], policy.control, size)
    frames = film(pusher, lambda now: policy.act(now.observations[0])[None])[0]
    write_video(output, frames, 10.0, CODECS[output.suffix])
    distance = float(pusher.distance()[0])
    success = distance < pusher.task.tolerance
    if as_json:
        print(json.dumps({"output": str(output), "final_distance": distance, "success": success}))
        return
    verdict = "success" if success else "no success"
    print(f"{output}: {cell} run {run} ends {100 * distance:.1f} cm from the goal: {verdict}")
