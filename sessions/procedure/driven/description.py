"""The text commands of a rate table, as a TOML file that holds those of its manual."""

import re
import tomllib
from pathlib import Path
from typing import Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
)

from inertial.toml_file import parsed, text_of

DESCRIPTIONS = Path(__file__).parent / "tables"


class TableError(RuntimeError):
    """A table that does not do what it is told; the text says which, what was sent and answered."""


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Limits(_Part):
    """What the table can; more is not asked of it."""

    rate_dps: float = Field(gt=0)
    acceleration_dps2: float = Field(gt=0)


class Commands(_Part):
    """Texts that are sent; an empty one is not sent."""

    set_rate: str = Field(min_length=1)
    read_rate: str
    stop: str
    identify: str = ""
    remote: str = ""
    local: str = ""
    set_acceleration: str = ""
    watchdog: str = ""
    keep_alive: str = ""

    @field_validator("set_rate", "watchdog")
    @classmethod
    def _has_number(cls, text: str, info: ValidationInfo) -> str:
        number = "{seconds}" if info.field_name == "watchdog" else "{rate}"
        if text and number not in text:
            raise ValueError(f"want {number} where the number goes")
        return text


class Replies(_Part):
    """Regular expressions; of `rate` the first group is the number."""

    rate: str
    identify: str = ""

    @field_validator("rate", "identify")
    @classmethod
    def _is_one(cls, text: str) -> str:
        try:
            re.compile(text)
        except re.error as error:
            raise ValueError(f"no regular expression: {error}") from None
        return text


class Description(_Part):
    """The whole file."""

    title: str = Field(min_length=1, max_length=100)
    unit: Literal["deg/s", "rad/s", "rpm"] = "deg/s"
    digits: int = Field(default=4, ge=0, le=9)
    terminator: str = Field(default="\n", min_length=1, max_length=4)
    answer: str = ""
    timeout_s: float = Field(default=1.0, gt=0, le=10)
    watchdog_s: float = Field(default=3.0, ge=1, le=60)
    baud: int = Field(default=9600, ge=300, le=4_000_000)
    clockwise_is_positive: bool = False
    limits: Limits
    commands: Commands
    replies: Replies


def described(name: str | Path) -> Description:
    """The description of that file, or the one that comes with gyrofree under the name; raises
    TableError.
    """
    path = DESCRIPTIONS / f"{name}.toml"
    path = path if path.is_file() else Path(name)
    try:
        return Description.model_validate(parsed(text_of(path)))
    except OSError as error:
        there = ", ".join(sorted(one.stem for one in DESCRIPTIONS.glob("*.toml")))
        raise TableError(f"{path}: {error.strerror}; want a file, or one of {there}") from None
    except tomllib.TOMLDecodeError as error:
        raise TableError(f"{path}: not TOML: {error}") from None
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise TableError(f"{path}: {where}: {first['msg']}") from None
