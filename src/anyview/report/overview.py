"""The page's opening: the idea in one strip, the headline numbers, what was run and at what scale."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from anyview.report import thesis
from anyview.report.cells import OURS, in_order, label
from anyview.report.content import Exhibit, Section, Table
from anyview.report.inputs import Study
from anyview.report.metrics import Tree
from anyview.report.pictures import Strip, make_strip
from anyview.report.words import (
    NOT_STATED,
    listed,
    number,
    percent,
    percent_spread,
    published,
)

ACTIONS = 49


IDEA = (
    "One run of ours, of median final distance. Top: an expert’s demonstration, filmed from a viewpoint "
    "of its own. Middle: how the translator expects such demonstrations to look through the agent’s "
    "camera, the mean of several: this is what the agent is rewarded for matching. Bottom: the trained "
    "agent."
)


@dataclass(frozen=True)
class Headline:
    """One number that a reader came for."""

    title: str
    value: str
    detail: str


def idea_strip(study: Study) -> Strip | None:
    """Expert, translated and agent frames of a run of `ours`: the one of median final distance."""
    if OURS not in study.evaluations or "diverse" not in study.demonstrations:
        return None
    evaluation = study.evaluations[OURS]
    runs = evaluation.runs.sort_values("final_distance", kind="stable")
    agent, translated = np.split(evaluation.rollout(int(runs["run"].iloc[len(runs) // 2])), 2, axis=2)
    expert = study.demonstrations["diverse"].frames(evaluation.demonstrations[0])
    return make_strip([("expert", expert), ("translated", translated), ("agent", agent)])


def headlines(translation: Tree, imitation: Tree) -> Iterator[Headline]:
    """The numbers at the top, each with its interval and the thesis's value."""
    if OURS in imitation:
        ours = imitation[OURS]
        rate, *bounds = _bounds(ours, "success_rate")
        yield Headline(
            "Success of ours",
            percent(rate),
            f"95%: {100 * bounds[0]:.0f} to {100 * bounds[1]:.0f}%, {ours['runs']} runs; thesis "
            f"{percent(thesis.SUCCESSES[OURS] / thesis.RUNS)}",
        )
        distance, *bounds = _bounds(ours, "final_distance_median")
        yield Headline(
            "Median final distance of ours",
            f"{100 * distance:.1f} cm",
            f"95%: {100 * bounds[0]:.1f} to {100 * bounds[1]:.1f} cm; success is within 2 cm",
        )
    if "oracle" in imitation:
        rate, *bounds = _bounds(imitation["oracle"], "success_rate")
        yield Headline(
            "Success of the Oracle",
            percent(rate),
            f"95%: {100 * bounds[0]:.0f} to {100 * bounds[1]:.0f}%: the same learner on the true view; "
            f"thesis {percent(thesis.SUCCESSES['oracle'] / thesis.RUNS)}",
        )
    if "sim" in translation:
        loss, *bounds = _bounds(translation["sim"]["validation"], "loss")
        yield Headline(
            "Translator, simulated clips",
            number(loss),
            f"loss, 95%: {number(bounds[0])} to {number(bounds[1])}; "
            f"thesis {published(thesis.SIMULATION_LOSS)} in another scene",
        )


def section(study: Study, data: Tree) -> Section:
    """The chapter on what was run, at what scale, on which data."""
    text = (
        "The thesis’s sizes stand beside ours: read every result below at the scale on the right.",
        *_missing(study),
    )
    exhibits = (
        Exhibit("scale", "Scale", comparison=Table(("", "Thesis", "Here"), tuple(_scale(study)))),
        *_data(data),
    )
    return Section("scale-and-data", "What was run", text, exhibits)


def _missing(study: Study) -> Iterator[str]:
    """Which declared methods have no results: a partial study says so."""
    absent = [label(cell) for cell in in_order(study.params.methods) if cell not in study.evaluations]
    if absent:
        yield f"Not run in this study: {listed(absent)}."


def _scale(study: Study) -> Iterator[tuple[str, str, str]]:
    params = study.params
    sizes = {kind: len(demos.success) for kind, demos in study.demonstrations.items()}
    if sizes:
        here = listed(f"{size:,} {kind}" for kind, size in sizes.items())
        yield "Simulated demonstrations", f"{thesis.DEMONSTRATIONS:,}", here
    if "real" in study.splits:
        counts = study.splits["real"]["split"].value_counts()
        here = listed(f"{counts.get(name, 0)} {name}" for name in ("train", "validation", "extreme"))
        thesis_counts = (thesis.TRAIN_CLIPS, thesis.VALIDATION_CLIPS, thesis.EXTREME_CLIPS)
        stated = "{} train, {} validation and {} extreme".format(*thesis_counts)
        yield "Real clips" + (" (here: surrogate)" if study.surrogate else ""), stated, here
    if study.trainings:
        sim = params.translators.get("sim")
        if sim is not None:
            yield "Network of the sim translator", "sim", sim.architecture
        yield "Frames in a batch", str(thesis.BATCH), str(params.training.batch_size)
    lengths = {cell: int(training.curve["iteration"].max()) for cell, training in study.trainings.items()}
    for cell, reference in (("real-adam", thesis.ADAM), ("real-adadelta", thesis.ADADELTA), ("sim", None)):
        if cell in lengths:
            stated = NOT_STATED if reference is None else f"{reference.iterations:,}"
            yield f"Iterations of {cell}", stated, f"{lengths.pop(cell):,}"
    if lengths:
        here = listed(f"{length:,}" for length in sorted(set(lengths.values())))
        yield "Iterations of the other translators", NOT_STATED, here
    imitation = params.imitation
    yield "Runs of a method", str(thesis.RUNS), str(imitation.runs)
    steps = imitation.iterations * imitation.episodes_per_iteration * ACTIONS
    yield "Iterations of a policy", str(thesis.POLICY_ITERATIONS), str(imitation.iterations)
    yield "Environment steps of a run", NOT_STATED, f"{steps:,}"
    yield "Demonstrations averaged in a reward", NOT_STATED, str(imitation.demonstrations)
    yield "Seed", "42", str(params.base.seed)


def _data(data: Tree) -> Iterator[Exhibit]:
    rows = [
        (
            kind,
            f"{values['demos']:,}",
            percent_spread(*_bounds(values, "expert_success")),
            percent_spread(*_bounds(values, "acceptance")),
        )
        for kind, values in data["sim"].items()
    ]
    if rows:
        yield Exhibit(
            "demonstrations",
            "Simulated demonstrations",
            ("Contexts are accepted by geometry alone, never by whether the expert succeeds in them.",),
            table=Table(("Contexts", "Demonstrations", "Expert’s success", "Contexts accepted"), tuple(rows)),
        )
    if "real" in data:
        real = data["real"]
        names = ("recorded", "refused", "train", "validation", "extreme")
        yield Exhibit(
            "clips",
            "Real clips",
            (
                "Clips that came through ingest, clips that it refused, and the splits; pairs of views "
                "stay together.",
            ),
            table=Table(("", "Clips"), tuple((name.capitalize(), str(real[name])) for name in names)),
            surrogate=bool(real["surrogate"]),
        )


def _bounds(values: Tree, name: str) -> tuple[float, float, float]:
    return values[name], values[f"{name}_low"], values[f"{name}_high"]
