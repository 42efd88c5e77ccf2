"""Translators and embeddings: what each learns from, how they train, how they are assessed."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from anyview.config.values import Block, Count, CountOrNone, KeyRefused, NonNegative, Positive, WithExperts


class LossWeights(Block):
    """Weights of the translator's losses; 0 leaves a loss out."""

    translation: NonNegative
    reconstruction: NonNegative
    alignment: NonNegative
    places: NonNegative = Field(
        default=0.0,
        description="of keypoints away from marks: `keypoint` and `keypoint-relative`, on clips with marks",
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
    rehearsed: bool = Field(
        default=False, description="every other iteration after those is of that set again, as for keypoints"
    )


class TranslatorCell(WithExperts):
    """Stage `train`: one context translator."""

    dataset: str = Field(description="set of clips to learn from")
    architecture: Literal["real", "sim", "compact", "keypoint", "keypoint-relative"]
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
        description="tell T of the expert's whole clip: by the mean of Enc1 over 8 frames, or for keypoints "
        "by the last frame; not in the thesis",
    )
    batch_size: Count | None = Field(
        default=None, description="the cell's own instead of `training.batch_size`"
    )
    learning_rate: Positive | None = Field(
        default=None, description="the cell's own instead of `training.learning_rate`"
    )
    schedule: Literal["constant", "cosine"] | None = Field(
        default=None, description="the cell's own instead of `training.schedule`"
    )

    @model_validator(mode="after")
    def _places_of_keypoints(self) -> "TranslatorCell":
        if self.weights.places and not self.architecture.startswith("keypoint"):
            raise KeyRefused("weights.places", f"{self.architecture} has no keypoints to teach places")
        return self

    @model_validator(mode="after")
    def _experts_alone(self) -> "TranslatorCell":
        if self.other_experts and (self.augment or self.pairs != "any"):
            key = "augment" if self.augment else "pairs"
            raise KeyRefused(
                key, "other experts' clips are not augmented, and paired with `any` of the cell's"
            )
        return self


class EmbeddingCell(Block):
    """Stage `embed`: one time-contrastive embedding, for the `tcn` baseline."""

    dataset: str = Field(description="set of clips to learn from")
    iterations: Count
    dimensions: Count = Field(description="size of the embedding")
    margin: Positive = Field(description="triplet margin")


class CycleCell(WithExperts):
    """Stage `embed` of the pipeline beyond: XIRL's embedding, by cycles in time between whole clips."""

    dataset: str = Field(description="set of clips to learn from")
    experts: str = Field(description="set of the other half of the clips: of the rig, or `dataset` itself")
    iterations: Count
    dimensions: Count = Field(description="size of the embedding")
    clips: Annotated[int, Field(ge=4, le=1000, multiple_of=2)] = Field(
        description="clips in a batch, half of them of the experts"
    )
    frames: Annotated[int, Field(ge=2, le=1000)] = Field(description="frames of each, all of it at most")
    temperature: Positive = Field(description="of the softmax over frames, by squared distance")


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
