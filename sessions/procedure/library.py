"""Procedures by name: those that come with gyrofree, and those in a folder of the installation."""

import difflib
import functools
import logging
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from inertial.toml_file import parsed, text_of
from messages import text as texts
from sessions.procedure import model
from sessions.procedure.model import Plan, Procedure, plan_of

log = logging.getLogger(__name__)

TEMPLATES = Path(__file__).parent / "templates"
LONGEST = 65536  # characters of a procedure's file
STEPS = {
    "still": model.Still,
    "rate": model.Rate,
    "staircase": model.Staircase,
    "pose": model.Pose,
    "open": model.Open,
    "record": model.Record,
}


class ProcedureError(ValueError):
    """A procedure that cannot be used: one line per fault, with file and place."""


def names(folder: Path | None = None) -> list[str]:
    """What `find` knows, in order; a file of the folder hides a template of its name. One whose
    name cannot be shown is left out, and said in the log.
    """
    found = {path.stem for path in TEMPLATES.glob("*.toml")}
    own = sorted(folder.glob("*.toml")) if folder is not None and folder.is_dir() else []
    for path in own:
        fault = texts.check(path.stem) or ("" if path.is_file() else "it is no file")
        if fault:
            _say_once(f"{texts.plain(path)} is left out: {fault}")
        else:
            found.add(path.stem)
    return sorted(found)


@functools.cache
def _say_once(text: str) -> None:
    log.warning("%s", text)


def find(name: str, folder: Path | None = None) -> Plan:
    """The plan of a name; raises ProcedureError."""
    if name not in names(folder):
        near = difflib.get_close_matches(name, names(folder), 1)
        hint = f"did you mean {near[0]!r}? There are" if near else "there are"
        raise ProcedureError(f"no procedure {name!r}; {hint} {', '.join(names(folder))}")
    return read(path_of(name, folder))


@dataclass(frozen=True)
class Offer:
    """What is known of a procedure before it starts."""

    name: str
    title: str = ""
    top: float = 0.0  # rad/s, the fastest that it wants of the table
    seconds: float = 0.0  # that it takes at least
    steps: int = 0
    fault: str = ""  # why it cannot be used


def offers(folder: Path | None = None) -> list[Offer]:
    """Of each name; a file is read again when it has changed."""
    return [_offer(name, path_of(name, folder)) for name in names(folder)]


def _offer(name: str, path: Path) -> Offer:
    try:
        stamp = path.stat()
    except OSError as error:
        return Offer(name, fault=f"{path}: {error.strerror}")
    return _offer_of(name, path, stamp.st_mtime_ns, stamp.st_size)


@functools.lru_cache(maxsize=512)
def _offer_of(name: str, path: Path, changed_ns: int, size: int) -> Offer:  # noqa: ARG001
    try:
        plan = read(path)
    except ProcedureError as error:
        return Offer(name, fault=texts.plain(error, 400))
    top = max((abs(step.target) for step in plan.steps), default=0.0)
    title = texts.plain(plan.procedure.title, 200)
    return Offer(name, title, top, plan.least_seconds, len(plan.steps))


def path_of(name: str, folder: Path | None = None) -> Path:
    """The file of a name that `names` gives."""
    own = folder / f"{name}.toml" if folder is not None else None
    return own if own is not None and own.exists() else TEMPLATES / f"{name}.toml"


def read(path: Path) -> Plan:
    """The plan of a file; raises ProcedureError."""
    try:
        text = text_of(path)
    except OSError as error:
        raise ProcedureError(f"{path}: {error.strerror}") from None
    return of_text(text, path.stem, str(path))


def of_text(text: str, name: str, source: str = "") -> Plan:
    """The plan of a file's text; `source` names it in messages. Raises ProcedureError."""
    source = source or name
    if len(text) > LONGEST:
        raise ProcedureError(f"{source}: {len(text)} characters; want at most {LONGEST}")
    try:
        procedure = Procedure.model_validate(parsed(text))
    except tomllib.TOMLDecodeError as error:
        raise ProcedureError(f"{source}: not TOML: {error}") from None
    except ValidationError as error:
        lines = (_line(fault, source, text) for fault in error.errors())
        raise ProcedureError("\n".join(lines)) from None
    return Plan(name, text, procedure, plan_of(procedure))


def _line(fault: dict[str, Any], source: str, text: str) -> str:
    """One fault as a sentence with its place."""
    loc = list(fault["loc"])
    number = loc[1] if len(loc) > 1 and loc[0] == "steps" and isinstance(loc[1], int) else None
    kind = loc[2] if number is not None and len(loc) > 2 else None
    rest = [str(part) for part in (loc[3:] if number is not None else loc)]
    key = rest[-1] if rest else ""
    place = f"{source}{_line_number(text, number, key)}: "
    place += f"step {number + 1}" if number is not None else "the procedure"
    place += f" ({kind})" if kind in STEPS else ""
    what = fault["msg"].removeprefix("Value error, ")
    if fault["type"] == "extra_forbidden":
        known = _known(kind, rest)
        near = difflib.get_close_matches(key, known, 1)
        hint = f"did you mean {near[0]!r}? It" if near else "it"
        return f"{place} has no key {'.'.join(rest)!r}; {hint} knows {', '.join(known)}"
    if fault["type"] == "missing":
        return f"{place} wants {'.'.join(rest)!r}, which is not there"
    if fault["type"].startswith("union_tag"):
        return f"{place}: {_kind_of(fault)}want kind = one of {', '.join(STEPS)}"
    found = f" = {fault['input']!r}" if isinstance(fault["input"], str | int | float) else ""
    where = f" {'.'.join(rest)}{found}:" if rest else ":"
    return f"{place}{where} {what[:1].lower()}{what[1:]}"


def _kind_of(fault: dict[str, Any]) -> str:
    given = fault["input"].get("kind") if isinstance(fault["input"], dict) else None
    if given is None:
        return "no kind; "
    near = difflib.get_close_matches(str(given), STEPS, 1)
    return f"kind {given!r}; " + (f"did you mean {near[0]!r}? " if near else "")


def _known(kind: Any, rest: list[str]) -> list[str]:
    """Keys that may stand where `rest` leads."""
    part: type[BaseModel] = STEPS.get(kind, Procedure)
    if rest[:1] == ["limits"] and len(rest) == 3:
        return ["min", "max"]
    return list(part.model_fields)


def _line_number(text: str, step: int | None, key: str) -> str:
    """':N' of the line with the key, in that step; '' when it cannot be told."""
    current, at_header = -1, ""
    inside = step is None
    for number, line in enumerate(text.splitlines(), 1):
        if re.match(r"\s*\[\[\s*steps\s*\]\]", line):
            current += 1
            inside = current == step
            at_header = f":{number}" if inside else at_header
        elif re.match(r"\s*\[\s*limits\b", line):
            inside = step is None
        if inside and key and re.match(rf"\s*\[?[\w.]*\b{re.escape(key)}\b", line):
            return f":{number}"
    return at_header
