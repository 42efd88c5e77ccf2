"""Names and numbers that must fit those of other keys."""

from collections.abc import Collection, Iterator

from anyview.config.data import DemonstrationSet
from anyview.config.explanations import brief
from anyview.config.imitation import BeyondCell, GoalCell
from anyview.config.params import Params
from anyview.config.values import WithExperts
from anyview.paths import REAL, RENDERED
from anyview.runtime.errors import AnyviewError

_HANDS_TASK = "push"  # what is done in the rig's clips
_STEPS = 49  # of an episode


def check_references(params: Params, name: str) -> None:
    """Raise AnyviewError, with the key's name in the file ``name``, if a key does not fit the others."""
    _refuse_twins(params, name)
    for key, found, fitting in _references(params):
        if found not in fitting:
            listed = ", ".join(fitting) or "none yet"
            raise AnyviewError(f"{name}: {key}: {brief(found)} is none of these: {listed}")
    _refuse_pretraining_alone(params, name)
    _refuse_clips_that_nobody_sees(params, name)
    _refuse_a_short_memory(params, name)


def _as_hands_do(wanted: DemonstrationSet) -> bool:
    """Whether clips of the rig show what is done in this set: one goal, at the script's tempo."""
    return wanted.task == _HANDS_TASK and wanted.contexts != "choice" and wanted.tempo == "script"


def _by_transport(cell: BeyondCell | GoalCell) -> bool:
    """Whether a frame has no value by itself."""
    return isinstance(cell, BeyondCell) and cell.matching == "transport"


def _refuse_a_short_memory(params: Params, name: str) -> None:
    """Refuse a replay that does not hold the episodes of an iteration."""
    replay = params.imitation.ddpg.replay
    for key, block in (("imitation", params.imitation), ("beyond", params.beyond)):
        if replay < _STEPS * block.episodes_per_iteration:
            raise AnyviewError(
                f"{name}: imitation.ddpg.replay: {replay} steps are less than an iteration's "
                f"{block.episodes_per_iteration} episodes of {_STEPS} ({key}.episodes_per_iteration)"
            )


def _references(params: Params) -> Iterator[tuple[str, str, Collection[str]]]:
    """Names in ``params`` that must be those of other keys: (dotted key, name, the names that fit)."""
    sets = [*params.simulate.sets, REAL, RENDERED]
    yield from ((f"split.{name}", name, sets) for name in params.split)
    yield from ((f"beyond.split.{name}", name, list(params.beyond.sets)) for name in params.beyond.split)
    simulated = params.demonstration_sets
    for key, beyond in params.beyond.translators.items():
        yield from _clips_of(f"beyond.translators.{key}", beyond, [REAL, RENDERED], simulated)
        before = [REAL, RENDERED] if beyond.other_experts else list(simulated)
        yield f"beyond.translators.{key}.pretraining.dataset", beyond.pretraining.dataset, before
    for key, method in params.beyond.cells.items():
        yield from _clips_of(f"beyond.cells.{key}", method, [method.dataset, REAL], simulated)
        fitting = params.beyond.embeddings if method.reward == "goal" else params.translator_cells
        yield f"beyond.cells.{key}.model", method.model, list(fitting)
    for key, embedding in params.beyond.embeddings.items():
        yield from _clips_of(f"beyond.embeddings.{key}", embedding, [embedding.dataset, REAL], simulated)
    by_step = [key for key, cell in params.beyond.cells.items() if not _by_transport(cell)]
    ranked = [*params.methods, *by_step]
    yield from (("beyond.ranking.methods", name, ranked) for name in params.beyond.ranking.methods)
    for block, models in (("translators", params.translators), ("embeddings", params.embeddings)):
        yield from ((f"{block}.{key}.dataset", cell.dataset, sets) for key, cell in models.items())
    for key, translator in params.translators.items():
        yield f"translators.{key}.pretraining.dataset", translator.pretraining.dataset, sets
        if translator.experts:
            yield f"translators.{key}.experts", translator.experts, [translator.dataset]
    yield "imitation.dataset", params.imitation.dataset, list(params.simulate.sets)
    for key, cell in params.imitation.cells.items():
        models_of = params.embeddings if cell.reward == "embedding" else params.translators
        yield f"imitation.cells.{key}.model", cell.model, models_of
    losses, diversity, headline = params.evidence.losses, params.evidence.diversity, params.evidence.headline
    yield from (("evidence.losses.translators", name, params.translators) for name in losses.translators)
    yield "evidence.diversity.translator", diversity.translator, params.translators
    yield "evidence.headline.translator", headline.translator, params.translators
    yield "evidence.headline.embedding", headline.embedding, params.embeddings
    for key, methods, model in (
        ("translated", headline.translated, headline.translator),
        ("embedded", headline.embedded, headline.embedding),
    ):
        having = [name for name, cell in params.imitation.cells.items() if cell.model == model]
        yield from ((f"evidence.headline.{key}", name, having) for name in methods)


def _clips_of(
    key: str, block: WithExperts, experts: Collection[str], simulated: dict[str, DemonstrationSet]
) -> Iterator[tuple[str, str, Collection[str]]]:
    """As ``_references``, the sets of a ``block``: of other experts' clips the own ones show the same."""
    yield f"{key}.dataset", block.dataset, list(simulated)
    if block.other_experts:
        yield f"{key}.experts", block.other_experts, experts
        by_hand = [name for name, wanted in simulated.items() if _as_hands_do(wanted)]
        yield f"{key}.dataset", block.dataset, by_hand


def _refuse_clips_that_nobody_sees(params: Params, name: str) -> None:
    """Refuse clips of its own or of other experts for a clock, and both for any method."""
    for key, cell in params.beyond.cells.items():
        clock = cell.reward == "clock"
        if clock and cell.own_clips:
            raise AnyviewError(f"{name}: beyond.cells.{key}.own_clips: a clock hears of no clip")
        if cell.other_experts and (clock or cell.own_clips):
            raise AnyviewError(
                f"{name}: beyond.cells.{key}.experts: other experts' clips are the same for every context, "
                "and no clock's"
            )


def _refuse_pretraining_alone(params: Params, name: str) -> None:
    """Refuse a translator that would never see clips of its own, or whose other clips nobody would open."""
    blocks = {"translators": params.translators, "beyond.translators": params.beyond.translators}
    for block, cells in blocks.items():
        for key, cell in cells.items():
            before, all_of_them = cell.pretraining.iterations, cell.iterations
            if before >= all_of_them:
                raise AnyviewError(
                    f"{name}: {block}.{key}.pretraining.iterations: {before} must be below "
                    f"{block}.{key}.iterations, {all_of_them}, which counts them"
                )
    evidence = params.evidence
    for key in (*evidence.losses.translators, evidence.diversity.translator, evidence.headline.translator):
        if params.translators[key].pretraining.iterations:
            raise AnyviewError(
                f"{name}: evidence: translators.{key}.pretraining.iterations: no translator of the evidence "
                "pretrains"
            )


def _refuse_twins(params: Params, name: str) -> None:
    """Refuse two cells that would write to one folder, and a set of clips that is never split."""
    made = [*params.simulate.sets, REAL, RENDERED]
    for block, key, other, taken in (
        ("embeddings", params.embeddings, "translators", params.translators),
        ("adversarial.cells", params.adversarial.cells, "imitation.cells", params.imitation.cells),
        ("simulate.sets", params.simulate.sets, "the clips that stage ingest makes", [REAL]),
        ("beyond.sets", params.beyond.sets, "simulate.sets, ingest or render", made),
        (
            "beyond.translators",
            params.beyond.translators,
            "translators or embeddings",
            [*params.translators, *params.embeddings],
        ),
        (
            "beyond.embeddings",
            params.beyond.embeddings,
            "translators or embeddings",
            [*params.translator_cells, *params.embeddings],
        ),
        ("beyond.cells", params.beyond.cells, "imitation.cells or adversarial.cells", params.methods),
        ("simulate.sets", params.simulate.sets, "the clips that stage render makes", [RENDERED]),
    ):
        for cell in key:
            if cell in taken:
                raise AnyviewError(f"{name}: {block}.{cell}: the name is taken by {other}")
    for block, sets, split in (
        ("split", made, params.split),
        ("beyond.split", params.beyond.sets, params.beyond.split),
    ):
        for dataset in sets:
            if dataset not in split:
                raise AnyviewError(f"{name}: {block}.{dataset}: missing key")
