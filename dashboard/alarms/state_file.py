"""The book in a file, for the next life of the service: written as a whole, or as it was before."""

import json
import logging
import os
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from dashboard.alarms.book import Book, Event
from dashboard.alarms.machine import Point
from dashboard.alarms.settings import LimitSettings
from inertial.whole_file import put_in_place
from messages.clock import Moment, elapsed_s

log = logging.getLogger(__name__)

FORMAT = 1
POINTS, EVENTS = TypeAdapter(list[Point]), TypeAdapter(list[Event])
LIMITS = TypeAdapter(list[LimitSettings])


def save(path: Path, book: Book, limits: list[LimitSettings], users: dict[str, str]) -> None:
    """users: who set a limit, by its name. Raises OSError."""
    content = {
        "format": FORMAT,
        "kept": list(Moment.now()),
        "points": [asdict(point) for point in book.points.values()],
        "history": [asdict(event) for event in book.history],
        "limits": [limit.model_dump() for limit in limits],
        "users": users,
    }
    write(path, content)


def write(path: Path, content: dict[str, Any]) -> None:
    """JSON that is on the disk when this returns. Raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with draft.open("w", encoding="utf-8") as stream:
            json.dump(content, stream, ensure_ascii=False)
            stream.flush()
            os.fsync(stream.fileno())
        put_in_place(draft, path)
    finally:
        draft.unlink(missing_ok=True)


def load(path: Path) -> tuple[Book, list[LimitSettings], dict[str, str], str]:
    """The book, the limits set on the page, who set them, and what is wrong with the file. A file
    that cannot be read is put aside, so that nothing of it is lost, and a new one is begun.
    """
    if not path.exists():
        return Book(), [], {}, ""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["format"] != FORMAT:
            raise ValueError(f"format {content['format']}, want {FORMAT}")
        # what elapsed counts from differs after a restart of the machine
        kept = Moment.of(content["kept"])
        if kept is None:
            raise ValueError("it does not say when it was kept")
        shift_s = elapsed_s() - kept.age_s - kept.elapsed_ns * 1e-9
        points = [_moved(p, shift_s) for p in POINTS.validate_python(_numbers(content["points"]))]
        book = Book({(p.device, p.id): p for p in points})
        book.history = EVENTS.validate_python(content["history"])
        return book, LIMITS.validate_python(content["limits"]), dict(content["users"]), ""
    except (OSError, ValueError, KeyError, TypeError, AttributeError, ValidationError) as error:
        return Book(), [], {}, _put_aside(path, str(error).splitlines()[0][:200])


def _put_aside(path: Path, why: str) -> str:
    aside = path.with_name(f"{path.name}.damaged")
    said = f"{path.name} cannot be read ({why}): alarms and the page's limits begin anew"
    try:
        os.replace(path, aside)
    except OSError as error:
        said += f"; it could not be put aside: {error.strerror}"
    log.error("%s: %s; the file is kept as %s", path, said, aside)
    return f"{said}; the file is kept as {aside.name}"


def _numbers(points: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Lists as the tuples that they were."""
    return [point | {"raises": tuple(point["raises"])} for point in points]


def _moved(point: Point, shift_s: float) -> Point:
    """Its times by this start of the machine."""
    until = point.shelved_until_s
    return replace(
        point,
        unknown=point.active,  # until it is looked at again
        raises=tuple(t + shift_s for t in point.raises),
        returned_s=point.returned_s + shift_s,
        shelved_until_s=max(until + shift_s, 1e-9) if until else 0.0,
    )
