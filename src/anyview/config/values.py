"""What blocks of params are built from."""

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, StringConstraints


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


class KeyRefused(ValueError):
    """One of a block's keys does not fit the others: its dotted name within the block, and why."""

    def __init__(self, key: str, why: str) -> None:
        super().__init__(why)
        self.key = key


class Block(BaseModel):
    """A block of params: no unknown keys, no silent conversions, no infinities."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class WithExperts(Block):
    """A block whose experts' clips are of its own set or of another."""

    dataset: str
    experts: str | None = None

    @property
    def other_experts(self) -> str | None:
        """The set of the experts' clips if it is not the block's own."""
        return None if self.experts == self.dataset else self.experts
