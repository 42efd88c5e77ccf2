"""What the page shows beside its text: figures, strips of stills, and clips that play."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from anyview.analysis.cells import ADAM, AUGMENTED, OURS, SIM, ablated, compared, in_order, label
from anyview.analysis.curves import PUBLISHED
from anyview.analysis.results import Results
from anyview.analysis.study import AssessedTranslator, EvaluatedMethod, SimulatedSet, Study
from anyview.report.figures import imitation, translation
from anyview.report.figures.style import to_svg
from anyview.report.formatting import centimetres
from anyview.report.pictures import Clip, Strip, make_clip, make_strip

_CLIPS = 4
_RUNS = 6


@dataclass(frozen=True)
class Illustrations:
    """By name, only what the study allows: figures as SVG text, strips, players' clips by their title.

    ``moving`` are animated WebP files, for a page elsewhere.
    """

    figures: dict[str, str]
    strips: dict[str, Strip]
    players: dict[str, dict[str, list[Clip]]]
    moving: dict[str, bytes] = field(default_factory=dict)


def illustrate(study: Study, results: Results) -> Illustrations:
    """Draw everything."""
    players = {"translated-clips": dict(_translated_clips(study)), "policies": dict(_rollouts(study))}
    return Illustrations(
        {name: to_svg(figure) for name, figure in _figures(results)},
        dict(_strips(study)),
        {name: clips for name, clips in players.items() if clips},
    )


def idea_strip(study: Study) -> Strip | None:
    """Expert, translated and agent frames of a run of `ours`: the one of median final distance."""
    if OURS not in study.methods or "diverse" not in study.simulated:
        return None
    return imitation_strip(study.methods[OURS], study.simulated["diverse"])


def imitation_strip(method: EvaluatedMethod, demonstrations: SimulatedSet) -> Strip:
    """A clip of the expert, its translation and the agent, in the run of median final distance."""
    agent, translated = np.split(method.rollout(method.median_run), 2, axis=2)
    expert = demonstrations.frames(method.demonstrations[0])
    return make_strip([("expert", expert), ("translated", translated), ("agent", agent)])


def typical_strip(translator: AssessedTranslator) -> Strip:
    """True over translated frames of the validation clip of median loss."""
    true, translated = np.split(translator.frames(translator.typical("validation")), 2, axis=2)
    return make_strip([("true", true), ("translated", translated)])


def _figures(results: Results) -> Iterator[tuple[str, "translation.Figure"]]:
    for name, (cell, published) in zip(("figure-13", "figure-14"), PUBLISHED.items(), strict=True):
        curve = results.losses[results.losses["cell"] == cell]
        if len(curve):
            yield name, translation.training(curve, published)
    weights = results.feature_weights
    if len(adam := weights.loc[weights["cell"] == ADAM, "weight"]):
        yield "figure-15", translation.feature_weights(adam)
    rates = results.imitation[results.imitation["metric"] == "success_rate"]
    if len(rates):
        yield "figure-19", imitation.success(rates[rates["cell"].isin(compared(rates["cell"]))])
        yield "learning", imitation.learning(results.learning)
    if set(ablated(rates["cell"])) > {OURS}:
        yield "figure-20", imitation.success(rates[rates["cell"].isin(ablated(rates["cell"]))])
    if len(results.differences):
        yield "differences", imitation.differences(results.differences)
    if len(results.factorial):
        yield "factorial", imitation.factorial(results.factorial)
    if len(shares := results.more[results.more["metric"].str.startswith("share_")]):
        yield "returns", imitation.returns(shares)


def _strips(study: Study) -> Iterator[tuple[str, Strip]]:
    if (idea := idea_strip(study)) is not None:
        yield "idea", idea
    translators = study.translators
    for name, cell in (("figure-16", ADAM), ("figure-18", SIM)):
        if cell in translators:
            yield name, typical_strip(translators[cell])
    extreme = [
        cell for cell in (ADAM, AUGMENTED) if cell in translators and translators[cell].filmed("extreme")
    ]
    if extreme:
        yield "figure-17", _last_frames({cell: translators[cell] for cell in extreme})


def _last_frames(translators: dict[str, AssessedTranslator]) -> Strip:
    """The last frame of each extreme clip: the true one, then each cell's translation."""
    rows: dict[str, np.ndarray] = {}
    clips = next(iter(translators.values())).filmed("extreme")
    for cell, translator in translators.items():
        pairs = np.stack([translator.frames(clip)[-1] for clip in clips])
        true, translated = np.split(pairs, 2, axis=2)
        rows = {"true": true, **rows, f"translated ({cell})": translated}
    return Strip(tuple(rows.items()), tuple(range(1, len(clips) + 1)))


def _translated_clips(study: Study) -> Iterator[tuple[str, list[Clip]]]:
    """The first clips of each split of three translators."""
    for cell in (SIM, ADAM, AUGMENTED):
        if cell not in study.translators:
            continue
        translator = study.translators[cell]
        for split in ("validation", "extreme"):
            if names := translator.filmed(split)[:_CLIPS]:
                yield (
                    f"{cell}, {split}",
                    [
                        make_clip(translator.frames(clip), f"{clip}: true left, translated right")
                        for clip in names
                    ],
                )


def _rollouts(study: Study) -> Iterator[tuple[str, list[Clip]]]:
    """The first runs, each of every method."""
    methods = {cell: study.methods[cell] for cell in in_order(study.methods)}
    for run in sorted({run for method in methods.values() for run in method.rollouts})[:_RUNS]:
        clips = []
        for cell, method in methods.items():
            if run in method.rollouts:
                distance = method.runs.set_index("run")["final_distance"][run]
                clips.append(make_clip(method.rollout(run), f"{label(cell)}: {centimetres(distance)}"))
        yield f"Run {run}", clips
