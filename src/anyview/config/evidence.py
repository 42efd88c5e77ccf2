"""What the pipeline `evidence` runs: several models of each kind."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from anyview.config.imitation import RewardWeights
from anyview.config.values import Block, Count, KeyRefused, Name
from anyview.paths import ANY_VIEW


def _distinct(values: list) -> list:
    if len(set(values)) < len(values):
        raise ValueError("one of them is listed twice")
    return values


def _rising(values: list) -> list:
    numbers = [value for value in values if value != ANY_VIEW]
    if values != sorted(set(numbers)) + values[len(numbers) :] or len(values) > len(numbers) + 1:
        raise ValueError("they must rise, so that each has more diversity than the one before")
    return values


Seeds = Annotated[list[Annotated[int, Field(ge=0)]], Field(min_length=1), AfterValidator(_distinct)]


class Budget(Block):
    """How much a part of the evidence trains, instead of what cells of the study do."""

    translator_iterations: Count = Field(description="of each translator, instead of the cell's own")
    iterations: Count = Field(description="of the policies, instead of `imitation.iterations`")
    episodes_per_iteration: Count = Field(description="instead of `imitation.episodes_per_iteration`")

    @property
    def policies(self) -> dict[str, int]:
        """What of `imitation` it replaces."""
        return {"iterations": self.iterations, "episodes_per_iteration": self.episodes_per_iteration}


class OtherRewards(Block):
    """Rewards under which some of the translators alone are evaluated."""

    seeds: Seeds = Field(description="of these translators: some of `evidence.losses.seeds`")
    rewards: dict[Name, RewardWeights] = Field(min_length=1)


class Losses(Budget):
    """Part `losses` of the evidence: the translators of figure 20, each trained several times, for `ours`."""

    translators: Annotated[list[str], AfterValidator(_distinct)] = Field(
        min_length=2, description="cells of `translators`; the first has every loss, the others lack some"
    )
    seeds: Seeds = Field(description="of the trainings, one of each translator for each seed")
    rewards: dict[Name, RewardWeights] = Field(min_length=1)
    others: OtherRewards

    @model_validator(mode="after")
    def _others_of_these(self) -> "Losses":
        if not set(self.others.seeds) <= set(self.seeds):
            raise KeyRefused("others.seeds", "some of them are not in evidence.losses.seeds")
        if twice := self.rewards.keys() & self.others.rewards.keys():
            raise KeyRefused(f"others.rewards.{min(twice)}", "the name is taken by rewards")
        return self

    @property
    def every_reward(self) -> dict[str, RewardWeights]:
        """Those for all of the translators, and the others."""
        return {**self.rewards, **self.others.rewards}

    def seeds_under(self, reward: str) -> list[int]:
        """Of the translators that are evaluated under ``reward``."""
        return self.seeds if reward in self.rewards else self.others.seeds


class Diversity(Budget):
    """Part `diversity` of the evidence: translators of more and more diverse contexts, for `ours`."""

    translator: str = Field(description="the cell of `translators` that each of them is trained as")
    views: Annotated[list[Count | Literal["any"]], AfterValidator(_rising)] = Field(
        min_length=1,
        description="from how many sides the demonstrations of `imitation.dataset` are seen; `any`: each "
        "from its own",
    )
    demonstrations: Annotated[list[Count], AfterValidator(_rising)] = Field(
        min_length=1, description="how many of them are learned from, drawn by the seed, with their split"
    )
    seeds: Seeds = Field(description="of the trainings, one of each translator for each seed")


class Headline(Budget):
    """Part `headline` of the evidence: the main methods, with several models each, at full budget."""

    translator: str = Field(description="the cell of `translators` that is the model of `translated`")
    embedding: str = Field(description="the cell of `embeddings` that is the model of `embedded`")
    translated: Annotated[list[str], AfterValidator(_distinct)] = Field(
        description="cells of `imitation.cells`"
    )
    embedded: Annotated[list[str], AfterValidator(_distinct)] = Field(
        description="cells of `imitation.cells`"
    )
    seeds: Seeds = Field(description="of the trainings, one translator and one embedding for each seed")
    embedding_iterations: Count = Field(description="of each embedding, instead of the cell's own")

    @property
    def cells(self) -> list[str]:
        """All of its methods."""
        return [*self.translated, *self.embedded]


class Evidence(Block):
    """What one run of the study cannot show, by the pipeline evidence/dvc.yaml: several models of a kind."""

    losses: Losses
    diversity: Diversity
    headline: Headline
