"""Sessions go when somebody says so, or by the rules of retention; never the one that is being
recorded.
"""

import logging
import shutil
import time
from dataclasses import dataclass

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
    now_s = time.time() if now_s is None else now_s
    oldest_first = sorted(catalogue.list(), key=lambda info: (info.start_utc_ns, info.id))
    total = sum(info.bytes for info in oldest_first)
    result = []
    for info in oldest_first:
        if (
            info.state not in ("closed", "recovered")
            or KEEP in read_annotations(catalogue.root / info.id).tags
        ):
            continue
        old = rule.days > 0 and now_s - info.start_utc_ns / 1e9 > rule.days * 86400.0
        big = 0 < rule.max_bytes < total
        if old or big:
            result.append(info)
            total -= info.bytes
    return result


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
