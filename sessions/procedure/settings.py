"""[procedures] of gyrofree.toml."""

from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field

from messages.contract.names import Name


class TableSettings(BaseModel):
    """A table that is driven for one device; without one a person turns it by hand."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    device: Name  # the board that stands on it
    port: str = Field(min_length=1)  # serial port by its by-id name, or tcp://host:port
    description: str = "simulated"  # TOML file of its text commands, or the name of a shipped one


class ProcedureSettings(BaseModel):
    """Where runs of procedures are kept, and what they drive."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    root: Path = Path("var/procedures")  # what happened in each run; made when absent
    # procedures of this installation, as FILE.toml; they go before shipped ones of the same name
    folder: Path = Path("procedures")
    tables: list[TableSettings] = []
