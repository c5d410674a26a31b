"""Sessions go when somebody says so, or by the rules of retention; never the one that is being
recorded.
"""

import logging
import shutil
import time
from dataclasses import dataclass

from messages.clock import boot_id
from sessions.library.annotations import read_annotations
from sessions.library.catalogue import Catalogue, SessionInfo
from sessions.recording.manifest import SessionError

log = logging.getLogger(__name__)

KEEP = "keep"  # a session with this tag is never removed by a rule


@dataclass(frozen=True)
class Retention:
    """What may stay; zero means no limit."""

    days: float = 0.0
    max_bytes: int = 0


def remove(catalogue: Catalogue, session: str) -> int:
    """Delete a session's folder; the bytes freed. Raises SessionError for one that is open or does
    not exist.
    """
    info = catalogue.get(session)
    if info.state == "open":
        raise SessionError(
            f"session {session}: it is being recorded, or waits for its recovery; stop it first"
        )
    folder = catalogue.root / session
    size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    shutil.rmtree(folder)
    return size


def too_many(
    catalogue: Catalogue, rule: Retention, now_s: float | None = None
) -> list[SessionInfo]:
    """Sessions that the rule would remove, oldest first: closed or recovered ones without the tag
    `keep`.
    """
    oldest_first = sorted(
        catalogue.list(), key=lambda info: (info.number, info.start_utc_ns, info.id)
    )
    ages = _ages(oldest_first, now_s)
    total = sum(info.bytes for info in oldest_first)
    result = []
    for info in oldest_first:
        if (
            info.state not in ("closed", "recovered")
            or KEEP in read_annotations(catalogue.root / info.id).tags
        ):
            continue
        old = rule.days > 0 and ages[info.id] > rule.days * 86400.0
        big = 0 < rule.max_bytes < total
        if old or big:
            result.append(info)
            total -= info.bytes
    return result


def _ages(oldest_first: list[SessionInfo], now_s: float | None) -> dict[str, float]:
    """How old each session is at least, s, by what does not depend on a clock that may have been
    set: elapsed time within this start of the machine; else the wall clock, which counts from the
    session's time or a later one of a session before it, whichever is the newer, and is not
    believed where it has run ahead of elapsed time.
    """
    here = boot_id()
    of_this_boot = [
        one.written for one in oldest_first if one.written is not None and one.written.boot == here
    ]
    if now_s is None:
        now_s = min([time.time(), *(one.wall_ns * 1e-9 + one.age_s for one in of_this_boot)])
    ages, newest_s = {}, 0.0
    for info in oldest_first:
        written_s = info.start_utc_ns / 1e9
        newest_s = max(newest_s, written_s) if written_s <= now_s else newest_s
        began_s = newest_s if info.number else written_s
        ages[info.id] = max(0.0, now_s - began_s)
        if info.written in of_this_boot and _live(info):
            ages[info.id] = min(ages[info.id], info.written.age_s + info.seconds)
    return ages


def _live(info: SessionInfo) -> bool:
    """Was it written when it was recorded, and not made of an older log?"""
    end_s = info.start_utc_ns / 1e9 + info.seconds + sum(info.clock_steps)
    return info.written is not None and abs(info.written.wall_ns / 1e9 - end_s) < 86400.0


def retain(catalogue: Catalogue, rule: Retention, now_s: float | None = None) -> list[str]:
    """Apply the rule; ids of the sessions that are gone. One that cannot be removed is logged and
    stays.
    """
    gone = []
    try:
        going = too_many(catalogue, rule, now_s)
    except (SessionError, OSError) as error:
        log.error("retention: %s", error)
        return gone
    for info in going:
        try:
            size = remove(catalogue, info.id)
        except (SessionError, OSError) as error:
            log.error("retention: %s: %s", info.id, error)
            continue
        log.info("retention: %s deleted, %.1f MB freed", info.id, size / 1e6)
        gone.append(info.id)
    return gone
