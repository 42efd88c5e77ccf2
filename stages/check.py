"""Stage `check`: every key of params.yaml, and not just those that some stage reads, before the study runs.

It leaves no output. Where the params are sound but cannot teach anything, it says so.
"""

from anyview.config import Params, load_params
from anyview.runtime.errors import refuse_arguments, run_stage


def notes(params: Params) -> list[str]:
    """Sound params that a user will hardly have meant, a line each."""
    imitation = params.imitation
    episodes = imitation.iterations * imitation.episodes_per_iteration
    needed = {
        "ddpg": ("warmup_episodes", imitation.ddpg.warmup_episodes),
        "trpo": ("batch_episodes", imitation.trpo.batch_episodes),
    }
    learners = {cell.learner for cell in params.methods.values()}
    return [
        f"imitation: {episodes} episodes a run (iterations x episodes_per_iteration) are fewer than "
        f"{learner}.{key} {least}: {learner.upper()} learns nothing"
        for learner, (key, least) in needed.items()
        if learner in learners and episodes < least
    ]


def main(arguments: list[str]) -> None:
    refuse_arguments(arguments, "python stages/check.py")
    found = notes(load_params())
    print("\n".join(f"note: {note}" for note in found) or "params.yaml: every key is known and possible")


if __name__ == "__main__":
    run_stage(main)
