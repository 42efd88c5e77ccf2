"""The data: simulated demonstrations, real clips, splits."""

from typing import Literal

from pydantic import Field, model_validator

from anyview.config.values import Block, Count, CountOrFraction, CountOrNone, Name, Positive, TaskName


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
    tempo: Literal["script", "varied"] = Field(
        default="script",
        description="`script`: frame t means the same progress in all of them; `varied`: each approaches and "
        "pushes at a tempo of its own, as its manifest tells",
    )


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
