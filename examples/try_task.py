"""Try a task: how often its expert succeeds, and what that looks like.

    python examples/try_task.py TASK

Run it while you write the task. It draws 1,000 contexts that no evaluation uses. TASK.avi shows the expert in
six of them, as large as the agent will see it.
"""

import sys
from pathlib import Path

import numpy as np

from anyview.config import load_params
from anyview.pusher.contexts import sample_contexts
from anyview.pusher.expert import roll_out
from anyview.pusher.render import renderer
from anyview.pusher.task import load_task
from anyview.runtime.errors import AnyviewError, exit_code
from anyview.seeds import stream
from anyview.video.files import write_video

COUNT, SHOWN = 1000, 6


def main(arguments: list[str]) -> None:
    if len(arguments) != 1:
        raise AnyviewError("usage: python examples/try_task.py TASK")
    (name,) = arguments
    params, task = load_params(), load_task(name)
    contexts, accepted = sample_contexts(stream(params.base.seed, "example"), COUNT, task=name)
    positions, distances = roll_out(contexts)
    camera = renderer(name, params.sim.image_size)
    clips = [camera.render_clip(*each) for each in zip(contexts[:SHOWN], positions[:SHOWN], strict=True)]
    video = Path(f"{name}.avi")
    write_video(video, np.concatenate(clips, axis=2), 10.0)
    solved = (distances < task.tolerance).sum()
    print(f"the expert solves {solved} of {COUNT} contexts, {accepted:.2%} of those proposed; see {video}")


if __name__ == "__main__":
    sys.exit(exit_code(lambda: main(sys.argv[1:])))
