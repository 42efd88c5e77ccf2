"""What the page shows of other tasks than the thesis's."""

from collections.abc import Iterator

from anyview.analysis.cells import label
from anyview.analysis.study import Study
from anyview.analysis.tasks import by_task
from anyview.report.formatting import centimetres
from anyview.report.illustrations import imitation_strip
from anyview.report.pictures import Clip, Strip, make_clip

_RUNS = 2


def task_strips(study: Study) -> Iterator[tuple[str, Strip]]:
    """For each task the expert, its translation and the agent, of the first method that translates."""
    cells = study.params.beyond.cells
    for task, methods in by_task(study).items():
        for cell, method in methods.items():
            if cells[cell].reward == "translated" and cells[cell].dataset in study.simulated:
                yield f"task-{task}", imitation_strip(method, study.simulated[cells[cell].dataset])
                break


def task_rollouts(study: Study) -> Iterator[tuple[str, list[Clip]]]:
    """The first runs of every method, by task."""
    for task, methods in by_task(study).items():
        clips = []
        for cell, method in methods.items():
            for row in method.runs[method.runs["run"].isin(method.rollouts)][:_RUNS].itertuples():
                caption = f"{label(cell)}, run {row.run}: {centimetres(row.final_distance)}"
                clips.append(make_clip(method.rollout(int(row.run)), caption))
        if clips:
            yield task.capitalize(), clips
