"""The smallest and the largest value of a figure that pass."""

from pydantic import BaseModel, ConfigDict, model_validator


class Limit(BaseModel):
    """Smallest and largest value that pass, in the unit of the figure's name."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    min: float | None = None
    max: float | None = None

    @model_validator(mode="after")
    def _one_of_them(self) -> "Limit":
        if self.min is None and self.max is None:
            raise ValueError("want min, max or both")
        if self.min is not None and self.max is not None and self.min > self.max:
            raise ValueError(f"min {self.min:g} is above max {self.max:g}: nothing would pass")
        return self

    def passed(self, value: float | None) -> bool | None:
        """Whether a value is within; None where there is none, or it is not a number."""
        if value is None or value != value:
            return None
        above = self.min is None or value >= self.min
        return above and (self.max is None or value <= self.max)
