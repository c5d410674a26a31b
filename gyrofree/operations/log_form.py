"""Forms of a log line: for people, for a supervisor, for programs."""

import json
import logging
import math
import os
import traceback
from datetime import UTC, datetime

from gyrofree.operations.settings import LogSettings
from messages.text import plain

LINE = 4000  # characters of a message
TRACEBACK = 20_000  # characters of one
FORMAT = "GYROFREE_LOG_FORMAT"  # what a supervisor tells its children
SUPERVISED = "GYROFREE_SUPERVISED"
KNOWN = frozenset(vars(logging.makeLogRecord({}))) | {"message", "asctime", "taskName"}
NOISY = ("websockets", "uvicorn.access", "httpx", "asyncio", "httpcore")


class OneLine(logging.Formatter):
    """A message is one line: text from outside can neither begin another nor move the cursor."""

    def formatMessage(self, record: logging.LogRecord) -> str:
        record.message = plain(record.message, LINE)
        return super().formatMessage(record)


class JsonLine(logging.Formatter):
    """One JSON object a line, with a traceback inside it."""

    def __init__(self, service: str) -> None:
        super().__init__()
        self._service = service

    def format(self, record: logging.LogRecord) -> str:
        """time, level, service, message, logger, pid; fields: what the caller gave as `extra`."""
        line: dict[str, object] = {
            "time": _time(record.created),
            "level": record.levelname.lower(),
            "service": self._service,
            "message": plain(record.getMessage(), LINE),
            "logger": record.name,
            "pid": record.process,
        }
        fields = {name: _sound(value) for name, value in vars(record).items() if name not in KNOWN}
        if fields:
            line["fields"] = fields
        if record.exc_info and record.exc_info[0] is not None:
            line["traceback"] = "".join(traceback.format_exception(*record.exc_info))[-TRACEBACK:]
        return as_line(line)


def said(service: str, level: str, message: str) -> str:
    """A line that no logger wrote."""
    now = datetime.now(UTC).timestamp()
    return as_line({"time": _time(now), "level": level, "service": service, "message": message})


def as_line(line: dict[str, object]) -> str:
    """JSON that is one line, whatever is in it: what acts on a terminal is escaped, too."""
    return json.dumps(line, allow_nan=False)


def wanted(settings: LogSettings | None) -> str:
    """The format in force: what the one who started this process wants, else the setting."""
    return os.environ.get(FORMAT) or (settings.format if settings else "text")


def handler(service: str, settings: LogSettings | None = None) -> logging.Handler:
    """What writes on stderr; below a supervisor without time, which the supervisor writes
    itself.
    """
    made = logging.StreamHandler()
    if wanted(settings) == "json":
        made.setFormatter(JsonLine(service))
    elif SUPERVISED in os.environ:
        made.setFormatter(OneLine("%(levelname)s %(message)s"))
    else:
        made.setFormatter(OneLine("%(asctime)s %(levelname)-7s %(name)s: %(message)s"))
    return made


def start(
    service: str = "gyrofree", settings: LogSettings | None = None, verbose: bool = False
) -> None:
    """Log on stderr, from the level of the settings, or all with `verbose`."""
    level = "debug" if verbose else settings.level if settings else "info"
    logging.basicConfig(level=level.upper(), handlers=[handler(service, settings)], force=True)
    for noisy in NOISY:
        logging.getLogger(noisy).setLevel(logging.WARNING)


def _sound(value: object) -> object:
    """As JSON can have it."""
    if value is None or isinstance(value, str | bool | int):
        return value
    return value if isinstance(value, float) and math.isfinite(value) else plain(value, LINE)


def _time(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="milliseconds")[:-6] + "Z"
