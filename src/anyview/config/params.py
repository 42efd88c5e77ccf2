"""The whole of ``params.yaml``."""

from typing import Annotated, Any, Literal

from pydantic import Field

from anyview.config.data import DemonstrationSet, Real, Simulate, SplitSet
from anyview.config.evidence import Evidence
from anyview.config.imitation import (
    DDPG,
    TRPO,
    Adversarial,
    AdversarialCell,
    BeyondCell,
    DemonstrationCell,
    EmbeddingRewardCell,
    GoalCell,
    Imitation,
)
from anyview.config.translators import Assessment, CycleCell, EmbeddingCell, Training, TranslatorCell
from anyview.config.values import Block, Count, Name


class Base(Block):
    """Shared by every stage."""

    seed: int = Field(ge=0, description="root of every named random stream")


class Sim(Block):
    """The simulated world, the same for demonstrations and agents."""

    image_size: Literal[32, 64, 128] = Field(description="height and width of a frame in pixels")
    control: Literal["twist", "torque"] = Field(
        description="the agent's action: end-effector twist or joint torques"
    )


class Ranking(Block):
    """Stage `rank`: scripted rollouts, good and failed ones, under the rewards of methods."""

    methods: list[str] = Field(
        min_length=1, description="cells of `imitation`, `adversarial` and `beyond`: the methods"
    )
    rollouts: Count = Field(description="rollouts of each kind in a context")


class Beyond(Block):
    """What goes beyond the thesis, by the pipeline beyond/dvc.yaml: sets and cells as in the blocks above."""

    sets: dict[Name, DemonstrationSet]
    split: dict[Name, SplitSet]
    translators: dict[Name, TranslatorCell]
    embeddings: dict[Name, CycleCell]
    iterations: Count = Field(description="of the policies, instead of `imitation.iterations`")
    episodes_per_iteration: Count = Field(description="instead of `imitation.episodes_per_iteration`")
    cells: dict[Name, Annotated[BeyondCell | GoalCell, Field(discriminator="reward")]]
    ranking: Ranking


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
                "imitation": self._imitation_beyond(cells=cells),
                "adversarial": self.adversarial.model_copy(update={"cells": {}}),
            }
        )

    def imitating(self, name: str) -> "Params":
        """These params with the cell ``name`` of `beyond` as one of `imitation`, with what it sets itself."""
        cell = self.beyond.cells[name]
        learner: DDPG | TRPO = getattr(self.imitation, cell.learner)
        discount = learner.discount if cell.discount is None else cell.discount
        changed = {
            "dataset": cell.dataset,
            "demonstrations": cell.demonstrations,
            "runs": cell.runs or self.imitation.runs,
            "cells": {name: cell},
            cell.learner: learner.model_copy(update={"discount": discount}),
        }
        return self.model_copy(update={"imitation": self._imitation_beyond(**changed)})

    def _imitation_beyond(self, **changed: Any) -> Imitation:
        """`imitation` as of `beyond`, with what is ``changed``."""
        own = {name: getattr(self.beyond, name) for name in ("iterations", "episodes_per_iteration")}
        return self.imitation.model_copy(update=own | changed)

    @property
    def methods(self) -> dict[str, DemonstrationCell | EmbeddingRewardCell | GoalCell | AdversarialCell]:
        """Every method of the thesis's study, by its cell's name."""
        return {**self.imitation.cells, **self.adversarial.cells}
