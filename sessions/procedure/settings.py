"""[procedures] of gyrofree.toml."""

from pathlib import Path

from pydantic import BaseModel, ConfigDict

from messages.contract.names import Name
from messages.setting import setting


class TableSettings(BaseModel):
    """A table that is driven for one device; without one a person turns it by hand."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    device: Name = setting(..., "the board that stands on it")
    port: str = setting(..., "serial port by its by-id name, or `tcp://host:port`", min_length=1)
    description: str = setting(
        "simulated", "TOML file of its text commands, or the name of a shipped one"
    )


class ProcedureSettings(BaseModel):
    """Where runs of procedures are kept, and what they drive."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    root: Path = setting(
        Path("var/procedures"), "what happened in each run; made when absent", shown=True
    )
    folder: Path = setting(
        Path("procedures"),
        "procedures of this installation, as FILE.toml; they go before shipped ones of the same"
        " name",
    )
    tables: list[TableSettings] = setting([], "tables that are driven, a block for each")
