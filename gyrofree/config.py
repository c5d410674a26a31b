"""gyrofree.toml: one file, read once, refused loudly.

Each room owns the model of its section; this module puts them together, and turns what is wrong in
the file into one line per fault: file, line, section, what was found, what is wanted.
"""

import difflib
import re
import tomllib
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from dashboard.alarms.settings import AlarmSettings
from dashboard.settings import DashboardSettings
from estimator.settings import EstimatorSettings
from gateway.settings import GatewaySettings
from gyrofree.operations.settings import LogSettings, MetricsSettings
from inertial.toml_file import parsed, text_of
from messages.bus.settings import BusSettings
from messages.setting import setting
from sessions.procedure.settings import ProcedureSettings
from sessions.recording.settings import RecorderSettings
from sites.settings import SiteSettings

DEFAULT_PATH = Path("gyrofree.toml")


class ConfigError(ValueError):
    """What is wrong in the configuration, one line per fault."""


class Settings(BaseModel):
    """The whole file; a section that is absent takes its defaults."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    bus: BusSettings = setting(BusSettings(), "The bus between the processes")
    gateway: GatewaySettings = setting(GatewaySettings(), "The boards and the journal of each")
    estimator: EstimatorSettings = setting(EstimatorSettings(), "Samples become motion")
    recorder: RecorderSettings = setting(RecorderSettings(), "What crossed the bus, kept")
    procedures: ProcedureSettings = setting(
        ProcedureSettings(), "Where runs of procedures are kept, and what they drive"
    )
    alarms: AlarmSettings = setting(AlarmSettings(), "What is an alarm, and who is told")
    dashboard: DashboardSettings = setting(DashboardSettings(), "The page in the browser")
    site: SiteSettings = setting(SiteSettings(), "What home does for places that watch it")
    log: LogSettings = setting(LogSettings(), "What the services write on stderr")
    metrics: MetricsSettings = setting(MetricsSettings(), "Figures for Prometheus")


def load(path: Path) -> Settings:
    """Settings of a file; raises ConfigError with one line per fault."""
    try:
        text = text_of(path)
    except OSError as error:
        raise ConfigError(
            f"{path}: {error.strerror}; name another file with --config FILE"
        ) from None
    try:
        values = parsed(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path}: not TOML: {error}") from None
    return check(values, str(path), text)


def load_or_default(path: Path | None) -> Settings:
    """The named file; without a name ./gyrofree.toml if it is there, else all defaults."""
    if path is not None:
        return load(path)
    return load(DEFAULT_PATH) if DEFAULT_PATH.exists() else Settings()


def check(values: dict[str, Any], source: str, text: str = "") -> Settings:
    """Settings of parsed TOML; `source` and `text` only serve the messages."""
    try:
        return Settings.model_validate(values)
    except ValidationError as error:
        raise ConfigError(
            "\n".join(_line(fault, source, text) for fault in error.errors())
        ) from None


def _line(fault: dict[str, Any], source: str, text: str) -> str:
    """One fault as a sentence with its place."""
    *path, key = [str(part) for part in fault["loc"]] or ["?"]
    where = f"{source}{_line_number(text, path, key)}: [{'.'.join(path)}]" if path else source + ":"
    if fault["type"] == "extra_forbidden":
        what = "key" if path else "section"
        return f"{where} has no {what} {key!r}; {_nearest(key, _known(fault['loc']))}"
    if fault["type"] == "missing":
        return f"{where} wants {key!r}, which is not there"
    found = fault.get("input")
    return f"{where} {key} = {found!r}: {fault['msg'][:1].lower()}{fault['msg'][1:]}"


def _nearest(key: str, known: list[str]) -> str:
    near = difflib.get_close_matches(key, known, 1)
    return (f"did you mean {near[0]!r}? It" if near else "it") + f" knows {', '.join(known)}"


def _known(loc: tuple) -> list[str]:
    """Names that may stand at the place of `loc`."""
    model: Any = Settings
    for part in loc[:-1]:
        if isinstance(part, int) or part not in model.model_fields:
            continue
        model = _inner_model(model.model_fields[part].annotation)
    return list(model.model_fields)


def _inner_model(annotation: Any) -> Any:
    """The pydantic model inside list[...], dict[str, ...] or X | None."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for inner in getattr(annotation, "__args__", ()):
        found = _inner_model(inner)
        if found is not None:
            return found
    return None


def _line_number(text: str, path: list[str], key: str) -> str:
    """':N' of the line that sets `key` below the header of its section, or '' when it cannot be
    told.
    """
    section = ".".join(part for part in path if not part.isdigit())
    wanted = next((int(part) for part in path if part.isdigit()), 0)
    current, count = "", -1
    for number, line in enumerate(text.splitlines(), 1):
        header = re.match(r"\s*\[+\s*([\w.\-]+)\s*\]+", line)
        if header:
            current = header[1]
            count += current == section
        elif current == section and count >= wanted and re.match(rf"\s*{re.escape(key)}\s*=", line):
            return f":{number}"
    return ""
