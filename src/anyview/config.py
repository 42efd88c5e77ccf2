"""``params.yaml`` as strict typed models: an unknown or impossible key is refused by its dotted name."""

import reprlib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    StringConstraints,
    ValidationError,
    model_validator,
)
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from anyview.paths import REAL, RENDERED
from anyview.runtime.errors import AnyviewError


def _feasible(count: int) -> int:
    if count > 10_000_000:
        raise ValueError("no machine can do more than ten million of these")
    return count


def _count_or_fraction(value: float) -> float:
    if value >= 1 and value % 1 != 0:
        raise ValueError("must be a whole count or a fraction below 1")
    return value


Count = Annotated[int, Field(ge=1), AfterValidator(_feasible)]
CountOrNone = Annotated[int, Field(ge=0), AfterValidator(_feasible)]
NonNegative = Annotated[float, Field(ge=0)]
Positive = Annotated[float, Field(gt=0)]
CountOrFraction = Annotated[float, Field(gt=0), AfterValidator(_count_or_fraction)]
Fraction = Annotated[float, Field(ge=0, le=1)]
Discount = Annotated[float, Field(ge=0, lt=1)]
Name = Annotated[str, StringConstraints(pattern=r"^[a-z0-9][a-z0-9_-]{0,63}$")]  # of a folder, too

TaskName = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]{0,63}$")]  # of a module


class Block(BaseModel):
    """A block of params: no unknown keys, no silent conversions, no infinities."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class Base(Block):
    """Shared by every stage."""

    seed: int = Field(ge=0, description="root of every named random stream")


class Sim(Block):
    """The simulated world, the same for demonstrations and agents."""

    image_size: Literal[32, 64, 128] = Field(description="height and width of a frame in pixels")
    control: Literal["twist", "torque"] = Field(
        description="the agent's action: end-effector twist or joint torques"
    )


class DemonstrationSet(Block):
    """One set of simulated demonstrations."""

    task: TaskName = Field(
        description="a module of `src/anyview/tasks`, or one of your own, `anyview_<task>`"
    )
    contexts: Literal["diverse", "narrow", "choice"] = Field(
        description="`diverse`: seen from anywhere, with distractors; `narrow`: from four sides, without; "
        "`choice`: as diverse, with a red goal and a green one, of which a demonstration goes to either"
    )
    demos: Count = Field(description="demonstrations to render")


class Simulate(Block):
    """Stage `simulate`: the simulated demonstrations."""

    shard: Count = Field(description="demonstrations in one video shard")
    sets: dict[Name, DemonstrationSet]


class Film(Block):
    """Stage `film`: the surrogate webcam clips."""

    pairs: Count = Field(description="pairs of two views of one demonstration")
    singles: CountOrNone = Field(description="demonstrations that one camera saw")
    extreme_pairs: CountOrNone = Field(description="pairs of extreme distractor clips, for validation only")
    width: int = Field(
        ge=160, le=1920, multiple_of=32, description="width of a raw frame; the height is 9/16 of it"
    )


class Ingest(Block):
    """Stage `ingest`: raw clips to aligned small ones."""

    size: Literal[32, 48, 64] = Field(description="height and width of a clip in pixels")
    frames: int = Field(ge=8, le=10_000, description="frames of a clip")
    rate: Positive = Field(description="frames per second after resampling")
    max_megabytes: Positive = Field(description="a larger raw file is refused")
    even_exposure: bool = Field(
        description="bring each frame's exposure and white balance to those of its clip's first frame"
    )


class Render(Block):
    """Stage `render`: scenes of every look, to pretrain on. Their size is that of `real.ingest`."""

    demonstrations: Count = Field(
        description="demonstrations, each in a scene of its own, seen by two cameras"
    )
    moments: Count = Field(description="random moments of each, besides the first frame")


class Real(Block):
    """Real clips: where they come from and how they are brought into shape."""

    source: Literal["surrogate", "recorded"] = Field(
        description="`surrogate`: rendered stand-ins; `recorded`: your own clips in data/raw/recorded"
    )
    film: Film
    ingest: Ingest
    render: Render


class SplitSet(Block):
    """Split of one set of clips, by pair. Counts that the clips cannot fill are taken as proportions."""

    train: CountOrFraction | None = Field(
        default=None,
        description="clips to train on: a count, a fraction such as 0.85, or without it all that are left",
    )
    validation: CountOrFraction = Field(description="clips held out: a count, or a fraction such as 0.1")

    @model_validator(mode="after")
    def _fractions_of_one_whole(self) -> "SplitSet":
        if self.train is not None and self.train < 1 and self.validation < 1 < self.train + self.validation:
            raise ValueError("the fractions train and validation sum to more than 1")
        return self


class LossWeights(Block):
    """Weights of the translator's losses; 0 leaves a loss out."""

    translation: NonNegative
    reconstruction: NonNegative
    alignment: NonNegative
    places: NonNegative = Field(
        default=0.0,
        description="of keypoints away from marks: for the architecture `keypoint`, on clips with marks",
    )

    @model_validator(mode="after")
    def _some_loss(self) -> "LossWeights":
        if self.translation == self.reconstruction == self.alignment == 0:
            raise ValueError("at least one loss weight must be above 0")
        return self


class Pretraining(Block):
    """What a translator learns from before it sees its own clips."""

    dataset: str = Field(
        description="set of clips to pretrain on, or where the cell has `experts`, their set at first; the "
        "cell's own set where there is no pretraining"
    )
    iterations: CountOrNone = Field(description="how many of the cell's iterations that takes; 0 for none")


class TranslatorCell(Block):
    """Stage `train`: one context translator."""

    dataset: str = Field(description="set of clips to learn from")
    architecture: Literal["real", "sim", "compact", "keypoint"]
    optimizer: Literal["adam", "adadelta"]
    iterations: Count
    weights: LossWeights
    experts: str | None = Field(
        default=None,
        description="set of the experts' clips: one of the rig, in which a hand does what the cell's own "
        "clips show, or the cell's own set, as without this key",
    )
    pairs: Literal["any", "views"] = Field(
        default="any", description="clips to pair: `any` two, or the `views` of one demonstration"
    )
    pretraining: Pretraining
    augment: bool = Field(description="augment the contexts during training")
    mirror: bool = Field(default=False, description="mirror half of the clips during training")
    task_embedding: bool = Field(
        default=False,
        description="give T the mean of Enc1 over 8 frames of the expert's clip; not in the thesis",
    )
    schedule: Literal["constant", "cosine"] | None = Field(
        default=None, description="the cell's own instead of `training.schedule`"
    )

    @model_validator(mode="after")
    def _experts_alone(self) -> "TranslatorCell":
        if self.other_experts and (self.augment or self.pairs != "any"):
            raise ValueError("other experts' clips are not augmented, and paired with `any` of the cell's")
        return self

    @property
    def other_experts(self) -> str | None:
        """The set of the experts' clips if it is not the cell's own."""
        return None if self.experts == self.dataset else self.experts


class EmbeddingCell(Block):
    """Stage `embed`: one time-contrastive embedding, for the `tcn` baseline."""

    dataset: str = Field(description="set of clips to learn from")
    iterations: Count
    dimensions: Count = Field(description="size of the embedding")
    margin: Positive = Field(description="triplet margin")


class Training(Block):
    """Stages `train` and `embed`: shared by every cell."""

    batch_size: Count
    learning_rate: Positive
    schedule: Literal["constant", "cosine"] = Field(
        description="the rate stays, or falls to 0 along a cosine"
    )
    precision: Literal["bfloat16", "float32"] = Field(
        description="of the matrix products, bfloat16 only where the processor has it; weights stay float32"
    )
    validation_every: Count = Field(description="iterations between validations")
    validation_pairs: Count = Field(description="frame pairs in the fixed validation set")


class Assessment(Block):
    """Stage `translate`: shared by every translator."""

    clips: Count = Field(description="validation clips that are translated, at most")
    shown: Count = Field(description="clips of each split drawn as strips and written as videos, at most")
    permutations: Count = Field(description="other times that stand in for a frame when it is weighted")


class DDPG(Block):
    """Deep deterministic policy gradient."""

    hidden: list[Count] = Field(min_length=1, description="widths of policy and critic")
    policy_learning_rate: Positive = Field(description="Adam's rate for the policy")
    critic_learning_rate: Positive = Field(description="Adam's rate for the critic")
    discount: Discount = Field(description="weight of the next step's return")
    batch_size: Count
    updates_per_step: Positive = Field(description="updates for each step that a run acts in its context")
    preactivation_penalty: NonNegative = Field(
        description="weight in the policy's loss of the squared inputs of its tanh; 0 leaves it out"
    )
    target_rate: Annotated[float, Field(gt=0, le=1)] = Field(description="Polyak rate of the target networks")
    replay: Count = Field(description="transitions kept per run")
    recent_episodes: Count = Field(description="half of each batch comes from this many newest episodes")
    warmup_episodes: CountOrNone = Field(description="episodes of noise alone before updates start")
    n_step: Annotated[int, Field(ge=1, le=49)] = Field(description="rewards summed before bootstrapping")
    time_features: CountOrNone = Field(
        description="radial basis functions of time beside the observation; 0 leaves them out"
    )
    noise: Positive = Field(description="Ornstein-Uhlenbeck deviation at first, in units of the action range")
    noise_end: Positive = Field(description="the same at the end; it falls geometrically")
    noise_theta: Fraction = Field(description="Ornstein-Uhlenbeck mean reversion per step; 1 is white noise")


class TRPO(Block):
    """Trust-region policy optimisation."""

    hidden: list[Count] = Field(min_length=1, description="widths of the policy")
    initial_std: Positive = Field(description="of the Gaussian policy, in units of the action range")
    batch_episodes: Count = Field(description="episodes per policy step")
    discount: Discount = Field(description="weight of the next step's return")
    gae_lambda: Fraction = Field(description="of generalised advantage estimation")
    step: Positive = Field(description="bound on the mean KL divergence")
    damping: NonNegative = Field(description="added to the Fisher matrix's diagonal")
    conjugate_gradient_steps: Count = Field(description="for each policy step")


class Discriminator(Block):
    """Image discriminators of TPIL and GAIL."""

    batch_size: Count
    learning_rate: Positive
    steps: Count = Field(description="steps of the discriminator after each iteration")
    memory: Count = Field(
        description="newest episodes that it learns from, and that it then scores anew for the learner"
    )
    gradient_penalty: NonNegative = Field(
        description="weight of half the squared gradients of its logits by the frames of expert and agent; "
        "0 leaves it out"
    )
    domain_weight: NonNegative = Field(description="gradient reversal of TPIL's domain head")


class RewardWeights(Block):
    """Weights of a reward's terms, in units of what standing still costs unless `raw`; 0 leaves one out."""

    feature: NonNegative = Field(description="of L_f, the distance of features")
    image: NonNegative = Field(description="of L_i, the distance of pixels: phi where `feature` is 1")
    raw: bool = Field(default=False, description="the terms in their own units, as in equation 22")

    @model_validator(mode="after")
    def _some_term(self) -> "RewardWeights":
        if self.feature == self.image == 0:
            raise ValueError("at least one weight must be above 0")
        return self


class Incomplete(Block):
    """Clips that lack frames. The reward is given only at the steps of which there is a frame."""

    every: Annotated[int, Field(ge=1, le=49)] = Field(
        default=1, description="n where every n-th frame is there, from the first on"
    )
    until: Annotated[float, Field(gt=0, le=1)] = Field(
        default=1.0, description="the part of the clip, from its start, after which there is none"
    )

    @model_validator(mode="after")
    def _some_frame(self) -> "Incomplete":
        if self.every > 49 * self.until:
            raise ValueError("no frame but the first would be left")
        return self


class DemonstrationCell(Block):
    """One method rewarded by a demonstration in the agent's own view (equations 20 to 22)."""

    learner: Literal["ddpg", "trpo"]
    reward: Literal["translated", "true", "clock"] = Field(
        description="what is matched: the translated demonstrations, the true one (the oracle), or what the "
        "translator makes of no clip but the time step (the clock)"
    )
    model: str = Field(description="the translator: a cell of `translators`")
    weights: RewardWeights
    time_power: NonNegative = Field(description="reward at step t is weighted by (t/49) to this power")
    incomplete: Incomplete = Field(
        default=Incomplete(),
        description="which frames there are: every n-th (`every`), up to a part of the clip (`until`)",
    )


class EmbeddingRewardCell(Block):
    """One method rewarded by the distance to demonstrations in an embedding, which nothing translates."""

    learner: Literal["ddpg", "trpo"]
    reward: Literal["embedding"]
    model: str = Field(description="the embedding: a cell of `embeddings`")
    time_power: NonNegative = Field(description="reward at step t is weighted by (t/49) to this power")


ImitationCell = DemonstrationCell | EmbeddingRewardCell


class Imitation(Block):
    """Stage `imitate`: policies and their evaluation. `discriminate` shares all but the cells."""

    dataset: str = Field(description="simulated set whose held-out clips are imitated")
    demonstrations: Count = Field(description="clips that are imitated, the same for every run and method")
    runs: Count = Field(description="contexts, each with a policy of its own")
    group: Count = Field(description="runs in lockstep: with 2, 15 runs keep 8 cores busy instead of 2")
    iterations: Count
    episodes_per_iteration: Count = Field(
        description="episodes of 49 steps that each run acts in an iteration"
    )
    ddpg: DDPG
    trpo: TRPO
    cells: dict[Name, Annotated[ImitationCell, Field(discriminator="reward")]]


class AdversarialCell(Block):
    """One method whose reward a discriminator learns while the agent does."""

    learner: Literal["ddpg", "trpo"]
    reward: Literal["tpil", "gail"]


class Adversarial(Block):
    """Stage `discriminate`: TPIL and GAIL, with the runs and learners of `imitation`."""

    discriminator: Discriminator
    cells: dict[Name, AdversarialCell]


class BeyondCell(DemonstrationCell):
    """One method of the studies beyond the thesis, with the runs and learners of `imitation`."""

    dataset: str = Field(
        description="simulated set whose task is done; where its clips choose between two goals, every "
        "context is run twice, once for each"
    )
    experts: str = Field(
        description="set whose held-out clips are imitated: that of the rig's clips, or `dataset` itself"
    )
    demonstrations: Count = Field(
        description="clips that are imitated, of each choice; of a `clock`, training clips that it averages"
    )
    own_clips: bool = Field(
        default=False, description="every context imitates clips of its own, not all of them the same"
    )
    contexts: Literal["evaluation", "tuning"] = Field(
        default="evaluation", description="the random stream that the contexts are drawn from"
    )

    @property
    def other_experts(self) -> str | None:
        """The set of the clips that are imitated if it is not `dataset`."""
        return None if self.experts == self.dataset else self.experts

    @model_validator(mode="after")
    def _clips_to_own(self) -> "BeyondCell":
        if self.own_clips and self.reward == "clock":
            raise ValueError("own_clips: a clock hears of no clip")
        return self


class Beyond(Block):
    """What goes beyond the thesis, by the pipeline beyond/dvc.yaml: sets and cells as in the blocks above."""

    sets: dict[Name, DemonstrationSet]
    split: dict[Name, SplitSet]
    translators: dict[Name, TranslatorCell]
    cells: dict[Name, BeyondCell]


class Evidence(Block):
    """Pipeline `evidence`: the translators of figure 20, each trained several times, as models of `ours`."""

    translators: list[str] = Field(
        min_length=2, description="cells of `translators`; the first has every loss, the others lack some"
    )
    seeds: list[Annotated[int, Field(ge=0)]] = Field(
        min_length=1, description="of the trainings, one of each translator for each seed"
    )
    iterations: Count = Field(description="of each training, instead of the cell's own")
    rewards: dict[Name, RewardWeights] = Field(min_length=1)

    @model_validator(mode="after")
    def _all_different(self) -> "Evidence":
        if any(len(set(names)) < len(names) for names in (self.translators, self.seeds)):
            raise ValueError("a translator or a seed is listed twice")
        return self


class Params(Block):
    """The whole of ``params.yaml``."""

    base: Base
    sim: Sim
    simulate: Simulate
    real: Real
    split: dict[Name, SplitSet]
    training: Training
    translators: dict[Name, TranslatorCell]
    embeddings: dict[Name, EmbeddingCell]
    assessment: Assessment
    imitation: Imitation
    adversarial: Adversarial
    beyond: Beyond
    evidence: Evidence

    @property
    def demonstration_sets(self) -> dict[str, DemonstrationSet]:
        """Every simulated set, of the thesis and beyond."""
        return {**self.simulate.sets, **self.beyond.sets}

    @property
    def splits(self) -> dict[str, SplitSet]:
        """How every set of clips is split."""
        return {**self.split, **self.beyond.split}

    @property
    def translator_cells(self) -> dict[str, TranslatorCell]:
        """Every translator, of the thesis and beyond."""
        return {**self.translators, **self.beyond.translators}

    def going_beyond(self, *beside: str) -> "Params":
        """These params with the sets and cells of `beyond`, and methods ``beside`` them, for the thesis's."""
        cells = {**self.beyond.cells, **{name: self.imitation.cells[name] for name in beside}}
        return self.model_copy(
            update={
                "simulate": self.simulate.model_copy(update={"sets": self.beyond.sets}),
                "split": self.beyond.split,
                "translators": self.beyond.translators,
                "embeddings": {},
                "imitation": self.imitation.model_copy(update={"cells": cells}),
                "adversarial": self.adversarial.model_copy(update={"cells": {}}),
            }
        )

    def imitating(self, name: str) -> "Params":
        """These params with the cell ``name`` of `beyond` as one of `imitation`, which has its clips."""
        cell = self.beyond.cells[name]
        changed = {"dataset": cell.dataset, "demonstrations": cell.demonstrations, "cells": {name: cell}}
        return self.model_copy(update={"imitation": self.imitation.model_copy(update=changed)})

    @property
    def methods(self) -> dict[str, DemonstrationCell | EmbeddingRewardCell | AdversarialCell]:
        """Every method of the thesis's study, by its cell's name."""
        return {**self.imitation.cells, **self.adversarial.cells}


def read_yaml(path: Path) -> Any:
    """Parse a YAML 1.2 file (so that ``1e-3`` is a number, as DVC reads it)."""
    try:
        return YAML(typ="safe", pure=True).load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise AnyviewError(f"{path}: no such file; run from the root of the repository") from None
    except (YAMLError, ValueError) as error:  # ValueErrors: bytes that are no text, the 99th of May
        raise AnyviewError(f"{path}: not valid YAML: {' '.join(str(error).split())}") from None
    except RecursionError:
        raise AnyviewError(f"{path}: not valid YAML: nested too deeply") from None


def parse_params(values: Any, name: str = "params.yaml") -> Params:
    """Check ``values``; the first impossible key is named, with every other one counted."""
    try:
        params = Params.model_validate(values)
    except ValidationError as error:
        raise AnyviewError(f"{name}: {_explain(error)}") from None
    _refuse_twins(params, name)
    for key, found, fitting in _references(params):
        if found not in fitting:
            listed = ", ".join(fitting) or "none yet"
            raise AnyviewError(f"{name}: {key}: {_brief(found)} is none of these: {listed}")
    _refuse_pretraining_alone(params, name)
    _refuse_experts_of_one(params, name)
    return params


def load_params(path: Path = Path("params.yaml")) -> Params:
    """Read and check ``params.yaml``."""
    return parse_params(read_yaml(path), str(path))


def _references(params: Params) -> Iterator[tuple[str, str, Collection[str]]]:
    """Names in ``params`` that must be those of other keys: (dotted key, name, the names that fit)."""
    sets = [*params.simulate.sets, REAL, RENDERED]
    yield from ((f"split.{name}", name, sets) for name in params.split)
    yield from ((f"beyond.split.{name}", name, list(params.beyond.sets)) for name in params.beyond.split)
    for key, beyond in params.beyond.translators.items():
        yield f"beyond.translators.{key}.dataset", beyond.dataset, list(params.demonstration_sets)
        yield (
            f"beyond.translators.{key}.pretraining.dataset",
            beyond.pretraining.dataset,
            [REAL, RENDERED] if beyond.other_experts else list(params.demonstration_sets),
        )
        if beyond.other_experts:
            yield f"beyond.translators.{key}.experts", beyond.other_experts, [REAL, RENDERED]
    for key, method in params.beyond.cells.items():
        yield f"beyond.cells.{key}.dataset", method.dataset, list(params.demonstration_sets)
        yield f"beyond.cells.{key}.experts", method.experts, [method.dataset, REAL]
        yield f"beyond.cells.{key}.model", method.model, list(params.translator_cells)
    for block, models in (("translators", params.translators), ("embeddings", params.embeddings)):
        yield from ((f"{block}.{key}.dataset", cell.dataset, sets) for key, cell in models.items())
    for key, translator in params.translators.items():
        yield f"translators.{key}.pretraining.dataset", translator.pretraining.dataset, sets
        if translator.experts:
            yield f"translators.{key}.experts", translator.experts, [translator.dataset]
    yield "imitation.dataset", params.imitation.dataset, list(params.simulate.sets)
    for key, cell in params.imitation.cells.items():
        fitting = params.embeddings if cell.reward == "embedding" else params.translators
        yield f"imitation.cells.{key}.model", cell.model, fitting
    yield from (("evidence.translators", name, params.translators) for name in params.evidence.translators)


def _refuse_experts_of_one(params: Params, name: str) -> None:
    """Refuse other experts for a cell of whose contexts each would need clips of its own, or none."""
    for key, cell in params.beyond.cells.items():
        if cell.other_experts and (cell.own_clips or cell.reward == "clock"):
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
    for key in params.evidence.translators:
        if params.translators[key].pretraining.iterations:
            raise AnyviewError(
                f"{name}: evidence.translators: {key} pretrains (translators.{key}.pretraining.iterations), "
                "and those of the evidence do not"
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


def _explain(error: ValidationError) -> str:
    # Unknown keys first: one that is missing beside them is most often the same one, misspelt.
    first, *others = sorted(error.errors(), key=lambda found: found["type"] != "extra_forbidden")
    loc = first["loc"]
    if loc[:2] == ("imitation", "cells"):
        loc = loc[:3] + loc[4:]  # without the tag of the reward's kind
    key = ".".join(str(part) for part in loc if part != "[key]") or "the file"
    if first["type"] == "extra_forbidden":
        message = "unknown key"
    elif first["type"] == "missing":
        message = "missing key"
    else:
        message = first["msg"].removeprefix("Value error, ")
        if first["type"].startswith("union_tag"):
            key += ".reward"
            message = "Input should be 'translated', 'true', 'clock' or 'embedding'"
        if not isinstance(first["input"], dict | list | set):  # aliases can make these endless
            message += f", got {_brief(first['input'])}"
    return f"{key}: {message}" + (f" (and {len(others)} more)" if others else "")


def _brief(value: Any) -> str:
    try:
        return reprlib.repr(value)
    except ValueError:  # Python refuses to write out numbers of thousands of digits
        return "a giant number"
