"""``params.yaml`` as strict typed models: an unknown or impossible key is refused by its dotted name."""

import reprlib
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

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


class Block(BaseModel):
    """A block of params: no unknown keys, no silent conversions, no infinities."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class Base(Block):
    """Shared by every stage."""

    seed: int = Field(ge=0, description="root of every named random stream")


class Sim(Block):
    """The pusher's world, the same for demonstrations and agents."""

    image_size: Literal[32, 64, 128] = Field(description="height and width of a frame in pixels")
    control: Literal["twist", "torque"] = Field(
        description="the agent's action: end-effector twist or joint torques"
    )


class DemonstrationSet(Block):
    """One set of simulated demonstrations."""

    demos: Count = Field(description="demonstrations to render")


class Simulate(Block):
    """Stage `simulate`: the simulated demonstrations."""

    shard: Count = Field(description="demonstrations in one video shard")
    diverse: DemonstrationSet
    narrow: DemonstrationSet


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


class Real(Block):
    """Real clips: where they come from and how they are brought into shape."""

    source: Literal["surrogate", "recorded"] = Field(
        description="`surrogate`: rendered stand-ins; `recorded`: your own clips in data/real/raw"
    )
    film: Film
    ingest: Ingest


class SplitSim(Block):
    """Split of a simulated set."""

    validation: CountOrFraction = Field(
        description="demonstrations held out: a count, or a fraction such as 0.1"
    )


class SplitReal(Block):
    """Split of the real clips, by pair. Counts that the data cannot fill are taken as proportions."""

    train: CountOrFraction = Field(description="clips to train on: a count, or a fraction such as 0.85")
    validation: CountOrFraction = Field(description="clips held out: a count, or a fraction")

    @model_validator(mode="after")
    def _fractions_of_one_whole(self) -> "SplitReal":
        if self.train < 1 and self.validation < 1 and self.train + self.validation > 1:
            raise ValueError("the fractions train and validation sum to more than 1")
        return self


class Split(Block):
    """Stage `split`."""

    sim: SplitSim
    real: SplitReal


class LossWeights(Block):
    """Weights of the translator's losses; 0 leaves a loss out."""

    translation: NonNegative
    reconstruction: NonNegative
    alignment: NonNegative

    @model_validator(mode="after")
    def _some_loss(self) -> "LossWeights":
        if self.translation == self.reconstruction == self.alignment == 0:
            raise ValueError("at least one loss weight must be above 0")
        return self


class TranslatorCell(Block):
    """One translator to train."""

    method: Literal["translator"]
    dataset: Literal["sim-diverse", "sim-narrow", "real"]
    architecture: Literal["real", "sim", "compact"]
    optimizer: Literal["adam", "adadelta"]
    iterations: Count
    weights: LossWeights
    augment: bool = Field(description="augment the contexts during training")


class EmbeddingCell(Block):
    """The time-contrastive embedding of the `tcn` baseline."""

    method: Literal["time-contrastive"]
    dataset: Literal["sim-diverse", "sim-narrow", "real"]
    iterations: Count
    dimensions: Count = Field(description="size of the embedding")
    margin: Positive = Field(description="triplet margin")


class Training(Block):
    """Shared by every translator cell."""

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


class Evaluation(Block):
    """Stage `translate`, shared by every translator cell."""

    clips: Count = Field(description="validation clips that are translated, at most")
    shown: Count = Field(description="clips of each split drawn as strips and written as videos, at most")
    permutations: Count = Field(description="other times that stand in for a frame when it is weighted")


class Translation(Block):
    """Stages `train` and `translate`."""

    training: Training
    evaluation: Evaluation
    cells: dict[str, Annotated[TranslatorCell | EmbeddingCell, Field(discriminator="method")]]


class Reward(Block):
    """The translated demonstration's reward (equations 20 to 22)."""

    phi: NonNegative = Field(
        description="weight of L_i beside L_f, each in units of what standing still costs"
    )
    time_power: NonNegative = Field(description="reward at step t is weighted by (t/49) to this power")
    demonstrations: Count = Field(description="demonstrations whose translations are averaged")


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
    time_bumps: CountOrNone = Field(
        description="Gaussian bumps over the episode that show the networks the time"
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
    steps: Count = Field(description="steps of the discriminator after the episodes of each policy step")
    domain_weight: NonNegative = Field(description="gradient reversal of TPIL's domain head")


_LEARNED = ("gail", "tpil")  # rewards that train on what the agent does


class ImitationCell(Block):
    """One method to evaluate."""

    learner: Literal["ddpg", "trpo"]
    reward: Literal["translated", "true", "embedding", "tpil", "gail"]
    source: str = Field(
        description="what the reward is made from: a model folder, or the discriminator's module"
    )
    feature: bool = Field(description="use the feature reward L_f")
    image: bool = Field(description="use the image reward L_i")
    reads: Literal["reward", "reward.time_power", "discriminator"] = Field(
        description="the part of `imitation` that the reward reads: the cell is run again when it changes"
    )

    @field_validator("reward")
    @classmethod
    def _has_batches(cls, reward: str, info: ValidationInfo) -> str:
        learner = info.data.get("learner")
        if reward in _LEARNED and learner not in ("trpo", None):
            raise ValueError(f"learns from the batches of trpo, not of {learner}")
        return reward

    @field_validator("reads")
    @classmethod
    def _reads_what_the_reward_does(cls, reads: str, info: ValidationInfo) -> str:
        reward, both = info.data.get("reward"), info.data.get("feature") and info.data.get("image")
        weighed = reward in ("translated", "true") and both
        expected = "discriminator" if reward in _LEARNED else "reward" if weighed else "reward.time_power"
        if info.data.keys() >= {"reward", "feature", "image"} and reads != expected:
            raise ValueError(f"must be {expected!r} for this reward")
        return reads

    @model_validator(mode="after")
    def _some_reward(self) -> "ImitationCell":
        if not (self.feature or self.image):
            raise ValueError("feature and image are both false: there is no reward left")
        return self


class Imitation(Block):
    """Stage `imitate`: policies and their evaluation."""

    runs: Count = Field(description="contexts, each with a policy of its own")
    iterations: Count
    episodes_per_iteration: Count = Field(
        description="episodes of 49 steps that each run acts in an iteration"
    )
    reward: Reward
    ddpg: DDPG
    trpo: TRPO
    discriminator: Discriminator
    cells: dict[str, ImitationCell]

    @field_validator("cells")
    @classmethod
    def _phi_leaves_a_reward(
        cls, cells: dict[str, ImitationCell], info: ValidationInfo
    ) -> dict[str, ImitationCell]:
        reward = info.data.get("reward")
        for name, cell in cells.items():
            if reward is not None and reward.phi == 0 and not cell.feature:
                raise ValueError(f"{name} has no feature reward, and imitation.reward.phi 0 leaves no other")
        return cells


class Params(Block):
    """The whole of ``params.yaml``."""

    base: Base
    sim: Sim
    simulate: Simulate
    real: Real
    split: Split
    translation: Translation
    imitation: Imitation


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
    for key, cell in params.imitation.cells.items():
        if cell.source not in (fitting := _sources(cell, params.translation)):
            raise AnyviewError(
                f"{name}: imitation.cells.{key}.source: for the reward {cell.reward} it must be "
                f"{' or '.join(fitting)}, got {_brief(cell.source)}"
            )
    return params


def load_params(path: Path = Path("params.yaml")) -> Params:
    """Read and check ``params.yaml``."""
    return parse_params(read_yaml(path), str(path))


def _sources(cell: ImitationCell, translation: Translation) -> list[str]:
    """What the reward of ``cell`` can be made from."""
    if cell.reward in _LEARNED:
        return [f"src/anyview/adversarial/{cell.reward}.py"]
    method = "time-contrastive" if cell.reward == "embedding" else "translator"
    return [f"data/models/{key}" for key, model in translation.cells.items() if model.method == method]


def _explain(error: ValidationError) -> str:
    # Unknown keys first: one that is missing beside them is most often the same one, misspelt.
    first, *others = sorted(error.errors(), key=lambda found: found["type"] != "extra_forbidden")
    tags = {"translator", "time-contrastive"}
    key = ".".join(str(part) for part in first["loc"] if part not in tags) or "the file"
    if first["type"] == "extra_forbidden":
        message = "unknown key"
    elif first["type"] == "missing":
        message = "missing key"
    else:
        message = first["msg"].removeprefix("Value error, ")
        if first["type"].startswith("union_tag"):
            key += ".method"
            message = f"Input should be {' or '.join(repr(tag) for tag in sorted(tags))}"
        if not isinstance(first["input"], dict | list | set):  # aliases can make these endless
            message += f", got {_brief(first['input'])}"
    return f"{key}: {message}" + (f" (and {len(others)} more)" if others else "")


def _brief(value: Any) -> str:
    try:
        return reprlib.repr(value)
    except ValueError:  # Python refuses to write out numbers of thousands of digits
        return "a giant number"
