"""The page of what goes beyond the thesis. It stands alone, so that the thesis's page needs nothing of it."""

import re
from collections.abc import Callable, Iterator

import numpy as np

from anyview.analysis.beyond import BeyondResults
from anyview.analysis.cells import label
from anyview.analysis.choice import CHOICE, choosing
from anyview.analysis.study import EvaluatedMethod, SimulatedSet, Study
from anyview.analysis.tasks import by_task
from anyview.report.figures import choice
from anyview.report.figures.style import to_svg
from anyview.report.formatting import centimetres
from anyview.report.illustrations import Illustrations, typical_strip
from anyview.report.pictures import Clip, Strip, make_clip, make_strip
from anyview.report.tasks import task_rollouts, task_strips
from anyview.report.text import by_cell, environment

_CONTEXTS = 4


def illustrate_beyond(study: Study, results: BeyondResults) -> Illustrations:
    """Draw everything."""
    figures = {"choices": to_svg(choice.choices(results.choices))} if len(results.choices) else {}
    strips = {f"translations-{cell}": typical_strip(entry) for cell, entry in study.translators.items()}
    if CHOICE in study.methods and CHOICE in study.simulated:
        strips["two-clips"] = two_clips(study.methods[CHOICE], study.simulated[CHOICE])
    strips |= dict(task_strips(study))
    players = {"rollouts": dict(_rollouts(study)), "task-rollouts": dict(task_rollouts(study))}
    return Illustrations(figures, strips, {name: clips for name, clips in players.items() if clips})


def two_clips(method: EvaluatedMethod, demonstrations: SimulatedSet) -> Strip:
    """One context under two clips: for each choice an expert's clip, its translation and the agent.

    The context is the one of median distance to the goal that was shown, the farther of its two runs.
    """
    farther = method.runs.groupby("context")["final_distance"].max().sort_values(kind="stable")
    runs = method.runs[method.runs["context"] == farther.index[len(farther) // 2]]
    rows = []
    for run, shown in zip(runs["run"], runs["choice"], strict=True):
        choices = demonstrations.manifest.set_index("clip")["choice"]
        clip = next(clip for clip in method.demonstrations if choices[clip] == shown)
        agent, translated = np.split(method.rollout(int(run)), 2, axis=2)
        rows += [
            (f"expert, {shown}", demonstrations.frames(clip)),
            ("translated", translated),
            ("agent", agent),
        ]
    return make_strip(rows)


def write_beyond(
    study: Study, results: BeyondResults, illustrations: Illustrations, picture: Callable[[str], str]
) -> str:
    """The page as Markdown; ``picture(name)`` stands where the illustration ``name`` belongs."""
    written = (
        environment(autoescape=False)
        .get_template("beyond.md.jinja")
        .render(
            params=study.params,
            illustrations=illustrations,
            picture=picture,
            data=by_cell(results.others.data),
            translation=by_cell(results.others.translation),
            choices=by_cell(results.choices),
            against_choice=list(results.against_choice.itertuples()),
            imitation=by_cell(results.others.imitation),
            tasks={task: list(methods) for task, methods in by_task(study).items()},
            outcomes=by_cell(results.tasks),
            differences=list(results.others.differences.itertuples()),
        )
    )
    return re.sub(r"\n{3,}", "\n\n", written).strip() + "\n"


def _rollouts(study: Study) -> Iterator[tuple[str, list[Clip]]]:
    """The first contexts, each of every method and both choices."""
    for context in range(_CONTEXTS):
        clips = []
        for cell, method in choosing(study.methods).items():
            for row in method.runs[method.runs["context"] == context].itertuples():
                caption = f"{label(cell)}, {row.choice} shown: {centimetres(row.final_distance)}"
                clips.append(make_clip(method.rollout(int(row.run)), caption))
        if clips:
            yield f"Context {context}", clips
