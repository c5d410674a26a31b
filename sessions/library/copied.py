"""What proves that a session here is home's: the hashes of both, kept beside the recording."""

import datetime as dt
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from inertial.whole_file import whole

FILE = "copied.json"


class Hashes(BaseModel):
    """Of one file: as home listed it, and as it was read back from the disk here."""

    model_config = ConfigDict(extra="ignore")

    home_sha256: str = Field(pattern="^[0-9a-f]{64}$")
    here_sha256: str = Field(pattern="^[0-9a-f]{64}$")

    @property
    def equal(self) -> bool:
        return self.home_sha256 == self.here_sha256


class Copied(BaseModel):
    """The content of copied.json."""

    model_config = ConfigDict(extra="ignore")

    home: str  # place that the session was recorded at
    here: str  # place of the copy
    equal_since: dt.datetime
    files: dict[str, Hashes]


def write_copied(folder: Path, copied: Copied) -> None:
    """Into a session's folder. Raises OSError."""
    with whole(folder / FILE) as draft:
        draft.write_text(copied.model_dump_json(indent=1) + "\n", encoding="utf-8")


def read_copied(folder: Path) -> Copied | None:
    """Of a session's folder; None where it is no copy, or what was written cannot be read."""
    try:
        return Copied.model_validate_json((folder / FILE).read_bytes())
    except (OSError, ValidationError):
        return None
