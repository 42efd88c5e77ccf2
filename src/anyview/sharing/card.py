"""The card of a model folder: what it holds, at which scale it was made, how good it is, how to use it."""

import inspect
import json
from pathlib import Path

from huggingface_hub import EvalResult, ModelCardData
from jinja2 import Environment, PackageLoader, StrictUndefined

from anyview.analysis.estimates import Estimate, Estimator, proportion
from anyview.analysis.study import EvaluatedMethod
from anyview.learners.common.policies import load_policy
from anyview.pusher.task import load_task
from anyview.review.results import flat
from anyview.sharing.checksums import CARD, POLICIES
from anyview.sharing.folder import Lock


def write_card(
    folder: Path, repo: str, method: str, evaluated: EvaluatedMethod, lock: Lock, licence: str
) -> None:
    """Write the card of ``method``, as it was ``evaluated``, into its model ``folder`` for ``repo``.

    ``lock`` is what ``make_folder`` returned, ``licence`` the hub's name of one, such as ``mit``.
    """
    params = {
        key: value
        for entry in lock.values()
        for file in entry.get("params", {}).values()
        for key, value in flat(file)
    }
    runs, run = evaluated.runs, evaluated.median_run
    success = proportion(int(runs["success"].sum()), len(runs))
    distances = runs["final_distance"].to_numpy(float)
    distance = Estimator(int(params.get("base.seed", 0))).median(f"{method}/final_distance", distances)
    task = load_policy(folder / POLICIES, run).context.task
    metrics = {"success rate": success, "median final distance, cm": _scaled(distance, 100)}
    data = ModelCardData(
        license=licence,
        library_name="anyview",
        pipeline_tag="robotics",
        tags=["robotics", "imitation-learning", "reinforcement-learning"],
        model_name=method,
        eval_results=[
            EvalResult(
                task_type="robotics",
                dataset_type=f"anyview-{task}",
                dataset_name=f"Anyview's task {task}, {len(runs)} runs",
                metric_type=metric,
                metric_value=round(estimate.value, 4),
            )
            for metric, estimate in metrics.items()
        ],
    )
    environment = Environment(
        loader=PackageLoader("anyview.sharing", "."), undefined=StrictUndefined, trim_blocks=True
    )
    text = environment.get_template("card.md.jinja").render(
        data=data.to_yaml(),
        repo=repo,
        method=method,
        task=task,
        aim=_aim(task),
        runs=len(runs),
        run=run,
        filmed=100 * runs.set_index("run")["final_distance"][run],
        tolerance=100 * load_task(task).tolerance,
        metrics=metrics,
        params={key: json.dumps(value) for key, value in params.items()},
        licence=licence,
        stages=list(lock),
    )
    (folder / CARD).write_text(text, encoding="utf-8")


def _aim(task: str) -> str:
    """What the module of ``task`` says first, behind its name: one sentence, or nothing."""
    said = " ".join((inspect.getdoc(inspect.getmodule(type(load_task(task)))) or "").split())
    return said.removeprefix(f"{task.capitalize()}: ").partition(". ")[0].rstrip(".")


def _scaled(estimate: Estimate, factor: float) -> Estimate:
    return Estimate(factor * estimate.value, factor * estimate.low, factor * estimate.high)
