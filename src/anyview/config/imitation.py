"""Methods: learners, rewards, and what is imitated."""

from collections.abc import Sequence
from typing import Annotated, Literal, NamedTuple

from pydantic import Field, SerializeAsAny, model_validator

from anyview.config.values import (
    Block,
    Count,
    CountOrNone,
    Discount,
    Fraction,
    KeyRefused,
    Name,
    NonNegative,
    Positive,
    WithExperts,
)


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
    average: CountOrNone = Field(
        description="updates, about, of which the policy that acts without noise has the mean weights; 0 for "
        "the last ones"
    )
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
    memory: Count = Field(description="newest episodes of an agent that it learns from")
    rescored: Count = Field(
        description="newest of them that it then scores anew; a learner on old data uses no others"
    )
    gradient_penalty: NonNegative = Field(
        description="weight of the mean squared gradient of its logits by the frames; 0 leaves it out"
    )
    halved: bool = Field(description="it sees frames at half their size, where 2 cm are half a pixel")
    shift: CountOrNone = Field(
        description="pixels by which what it learns from is shifted at random, at most"
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


class Shown(NamedTuple):
    """What the runs of a method are shown, and where: in the thesis's study all of them the same clips."""

    other_experts: str | None = None
    """The set of the clips if it is not that of the task."""
    own_clips: bool = False
    """Whether every context has clips of its own."""
    contexts: Literal["evaluation", "tuning"] = "evaluation"
    """The random stream that the contexts are drawn from."""
    angles: Sequence[int] = ()
    """Degrees between the cameras of clip and agent, once for each of which every context is run."""


class MethodCell(Block):
    """A cell of any stage that trains policies."""

    @property
    def shown(self) -> Shown:
        """What its runs are shown."""
        return Shown()


class DemonstrationCell(MethodCell):
    """One method rewarded by a demonstration in the agent's own view (equations 20 to 22)."""

    learner: Literal["ddpg", "trpo"]
    reward: Literal["translated", "true", "clock"] = Field(
        description="what is matched: the translated demonstrations, the true one (the oracle), or what the "
        "translator makes of no clip but the time step (the clock)"
    )
    model: str = Field(description="the translator: a cell of `translators`")
    weights: RewardWeights = RewardWeights(feature=1.0, image=1.0)
    time_power: NonNegative = Field(
        default=0.0, description="reward at step t is weighted by (t/49) to this power"
    )
    incomplete: Incomplete = Field(
        default=Incomplete(),
        description="which frames there are: every n-th (`every`), up to a part of the clip (`until`)",
    )
    matching: Literal["steps", "transport"] = Field(
        default="steps",
        description="`steps`: frame t is compared with frame t of the demonstrations' mean; `transport`: an "
        "episode's frames with those of each demonstration by optimal transport, whatever their tempo",
    )

    @model_validator(mode="after")
    def _transported(self) -> "DemonstrationCell":
        if self.matching == "transport":
            if self.reward != "translated":
                raise KeyRefused("matching", "transport is for translated demonstrations")
            if self.time_power:
                raise KeyRefused("time_power", "must be 0 where clips are matched by transport, not by step")
            if self.incomplete != Incomplete():
                raise KeyRefused("incomplete", "clips matched by transport have all their frames")
        return self


class EmbeddingRewardCell(MethodCell):
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
    # As what they are: those of `beyond` take their place in `Params.imitating`.
    cells: SerializeAsAny[dict[Name, Annotated[ImitationCell, Field(discriminator="reward")]]]


class AdversarialCell(MethodCell):
    """One method whose reward a discriminator learns while the agent does."""

    learner: Literal["ddpg", "trpo"]
    reward: Literal["tpil", "gail"]


class Adversarial(Block):
    """Stage `discriminate`: TPIL and GAIL, with the runs and learners of `imitation`."""

    discriminator: Discriminator
    cells: dict[Name, AdversarialCell]


class BeyondMethodCell(WithExperts, MethodCell):
    """A method of the studies beyond the thesis, with the runs and learners of `imitation`."""

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
    runs: Count | None = Field(default=None, description="how many contexts, instead of `imitation.runs`")
    discount: Discount | None = Field(default=None, description="instead of the learner's own")
    angles: list[Annotated[int, Field(ge=0, le=180)]] = Field(
        default=[],
        description="degrees between the camera of a clip and the agent's: every context is run once for "
        "each, with the clips of its own that are nearest to it",
    )

    @property
    def shown(self) -> Shown:
        return Shown(self.other_experts, self.own_clips, self.contexts, self.angles)

    @model_validator(mode="after")
    def _angles_of_own_clips(self) -> "BeyondMethodCell":
        if self.angles and not self.own_clips:
            raise KeyRefused("angles", "chosen for each context's own camera, which needs own_clips")
        if len(set(self.angles)) < len(self.angles):
            raise KeyRefused("angles", "one is listed twice")
        return self


class BeyondCell(BeyondMethodCell, DemonstrationCell):
    """One method of the studies beyond the thesis, with the runs and learners of `imitation`."""


class GoalCell(BeyondMethodCell):
    """One method rewarded by the distance to the demonstrations' last frames in an embedding: XIRL."""

    learner: Literal["ddpg", "trpo"]
    reward: Literal["goal"]
    model: str = Field(description="the embedding: a cell of `beyond.embeddings`")
