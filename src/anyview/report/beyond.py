"""The page of what goes beyond the thesis. It stands alone, so that the thesis's page needs nothing of it."""

import re
from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

import numpy as np

from anyview import paths
from anyview.analysis.beyond import BeyondResults
from anyview.analysis.cells import HUMAN, label
from anyview.analysis.choice import CHOICE, choosing
from anyview.analysis.clips import curves
from anyview.analysis.ranking import failures
from anyview.analysis.study import EvaluatedMethod, SimulatedSet, Study
from anyview.analysis.tasks import by_task
from anyview.analysis.viewpoints import SUCCESS, angles
from anyview.config import BeyondCell
from anyview.report.figures import choice, clips
from anyview.report.figures.style import to_svg
from anyview.report.figures.viewpoints import angle_curves
from anyview.report.formatting import centimetres
from anyview.report.illustrations import Illustrations, typical_strip
from anyview.report.pictures import Clip, Strip, animated_webp, label_view, make_clip, make_strip
from anyview.report.tasks import task_rollouts, task_strips
from anyview.report.text import by_cell, environment
from anyview.video.phases import frames_in_step, seconds_of
from anyview.video.pictures import resize
from anyview.video.sets import read_stored

_CONTEXTS = 4
_SCALE = 3  # of a view in the picture that moves


def illustrate_beyond(study: Study, results: BeyondResults) -> Illustrations:
    """Draw everything."""
    figures = {"choices": to_svg(choice.choices(results.choices))} if len(results.choices) else {}
    if len(results.clips):
        figures["clips"] = to_svg(clips.clip_curves(results.clips, _clip_curves(study, results)))
    if len(results.viewpoints):
        figures["viewpoints"] = to_svg(angle_curves(results.viewpoints))
    strips = {f"translations-{cell}": typical_strip(entry) for cell, entry in study.translators.items()}
    moving = {}
    if CHOICE in study.methods and CHOICE in study.simulated:
        both = shown_twice(study.methods[CHOICE], study.simulated[CHOICE])
        strips["two-clips"] = two_clips(both)
        moving["clip-decides"] = clip_decides(both)
    if (strip := hand_to_robot(study)) is not None:
        strips["hand-to-robot"] = strip
    strips |= dict(task_strips(study))
    players = {"rollouts": dict(_rollouts(study)), "task-rollouts": dict(task_rollouts(study))}
    shown = {name: titled for name, titled in players.items() if titled}
    return Illustrations(figures, strips, shown, moving)


class Shown(NamedTuple):
    """A run of `choice`: the goal that was shown and clips (T, H, W, 3).

    One clip of the expert's to that goal, what the translator makes of all of them, and the agent.
    """

    goal: str
    expert: np.ndarray
    translated: np.ndarray
    agent: np.ndarray


def shown_twice(method: EvaluatedMethod, demonstrations: SimulatedSet) -> list[Shown]:
    """Both runs of a context, that of median distance to the goal that was shown, the farther of the two."""
    farther = method.runs.groupby("context")["final_distance"].max().sort_values(kind="stable")
    runs = method.runs[method.runs["context"] == farther.index[len(farther) // 2]]
    choices = demonstrations.manifest.set_index("clip")["choice"]
    both = []
    for run, goal in zip(runs["run"], runs["choice"], strict=True):
        clip = next(clip for clip in method.demonstrations if choices[clip] == goal)
        agent, translated = np.split(method.rollout(int(run)), 2, axis=2)
        both.append(Shown(goal, demonstrations.frames(clip), translated, agent))
    return both


def two_clips(both: list[Shown]) -> Strip:
    """One context under two clips: the three rows of each."""
    rows = []
    for run in both:
        rows += [(f"expert, {run.goal}", run.expert), ("translated", run.translated), ("agent", run.agent)]
    return make_strip(rows)


def clip_decides(both: list[Shown]) -> bytes:
    """The same as a picture that moves, animated WebP: the expert, its translation and the agent abreast."""
    return animated_webp(
        [
            np.concatenate(
                [
                    label_view(run.expert, f"a clip: to {run.goal}", _SCALE),
                    label_view(run.translated, "translated", _SCALE),
                    label_view(run.agent, "the agent", _SCALE),
                ],
                axis=2,
            )
            for run in both
        ]
    )


def hand_to_robot(study: Study) -> Strip | None:
    """A hand's clip, its translation and the agent, in the run of `human` of median final distance."""
    method, folder = study.methods.get(HUMAN), paths.clip_set(paths.REAL)
    if method is None or not folder.exists():
        return None
    agent, translated = np.split(method.rollout(method.median_run), 2, axis=2)
    hand, _ = read_stored(folder, method.demonstrations[0])
    in_step = resize(hand[frames_in_step(seconds_of(len(hand)))], agent.shape[1])
    return make_strip([("a hand", in_step), ("translated", translated), ("agent", agent)])


def write_beyond(
    study: Study, results: BeyondResults, illustrations: Illustrations, picture: Callable[[str], str]
) -> str:
    """The page as Markdown; ``picture(name)`` stands where the illustration ``name`` belongs."""
    translated = by_cell(results.others.translation)
    of_hands = {cell for cell in translated if study.params.translators[cell].other_experts}
    written = (
        environment(autoescape=False)
        .get_template("beyond.md.jinja")
        .render(
            params=study.params,
            illustrations=illustrations,
            picture=picture,
            data=by_cell(results.others.data),
            translation={cell: row for cell, row in translated.items() if cell not in of_hands},
            of_hands={cell: row for cell, row in translated.items() if cell in of_hands},
            choices=by_cell(results.choices),
            against_choice=list(results.against_choice.itertuples()),
            clips=by_cell(results.clips),
            frames_of=partial(_frames_of, study),
            viewpoints=by_cell(results.viewpoints),
            angles=partial(_angles, results),
            rewards=by_cell(results.rewards),
            kinds=failures(results.rewards),
            imitation=by_cell(results.others.imitation),
            differences={row.cell: row for row in results.others.differences.itertuples()},
            tasks={task: list(methods) for task, methods in by_task(study).items()},
            outcomes=by_cell(results.tasks),
        )
    )
    return re.sub(r"\n{3,}", "\n\n", written).strip() + "\n"


def _clip_curves(study: Study, results: BeyondResults) -> list[tuple[str, dict[str, str]]]:
    """The title of each curve, and how its cells are called there."""
    cells = study.params.beyond.cells
    by_count, by_frames = curves(study.params, results.clips)
    named = [
        ("clips", {cell: str(cells[cell].demonstrations) for cell in by_count}),
        ("frames of each", {cell: _frames_of(study, cell) for cell in by_frames}),
    ]
    return [(title, labels) for title, labels in named if labels]


def _frames_of(study: Study, cell: str) -> str:
    """Which frames of its clips a method has."""
    method = study.params.beyond.cells[cell]
    assert isinstance(method, BeyondCell)
    incomplete = method.incomplete
    kept = "all" if incomplete.every == 1 else f"1 in {incomplete.every}"
    return kept if incomplete.until == 1 else f"first {incomplete.until:.0%}"


def _angles(results: BeyondResults, cell: str) -> list[str]:
    """The angles between the cameras at which a method was run, in degrees."""
    return [f"{angle:g}" for angle in angles(results.viewpoints, cell, SUCCESS)["angle"]]


def _rollouts(study: Study) -> Iterator[tuple[str, list[Clip]]]:
    """The first contexts, each of every method and both choices."""
    for context in range(_CONTEXTS):
        players = []
        for cell, method in choosing(study.methods).items():
            for row in method.runs[method.runs["context"] == context].itertuples():
                caption = f"{label(cell)}, {row.choice} shown: {centimetres(row.final_distance)}"
                players.append(make_clip(method.rollout(int(row.run)), caption))
        if players:
            yield f"Context {context}", players
