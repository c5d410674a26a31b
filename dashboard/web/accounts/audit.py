"""Who did what, when, from where, and with what result: a file that is only added to.

Lines of JSON beside the users file, readable by its owner; whole lines are written at once, also
by the command line in another process. At LARGEST it becomes `.1`, which the next one replaces.
"""

import json
import logging
import os
import threading
import time
from dataclasses import asdict, dataclass
from pathlib import Path

from dashboard.web.accounts.backoff import ADDRESSES, Backoff
from messages.text import plain

log = logging.getLogger("dashboard.audit")

LARGEST = 8 << 20  # bytes of one file
TAIL = 2 << 20  # bytes that are read to show the newest
TEXT = 300  # characters of one entry's text
EACH, SPAN_S = 60, 600.0  # refusals from one network that are all written down, within so long


@dataclass(frozen=True)
class Entry:
    """One act. utc_s: s since 1970."""

    utc_s: float
    who: str  # user, or what was given as one; empty: nobody
    address: str  # of his connection; empty: on the machine itself
    what: str
    result: str  # "done" or "refused"
    detail: str = ""


class Audit:
    """The file as the dashboard writes and shows it."""

    def __init__(self, users_file: Path) -> None:
        self.path = users_file.with_name(users_file.name + ".audit")
        self._lock = threading.Lock()
        self._refusals: dict[str, tuple[float, int]] = {}  # network -> since when, how many
        self.lost = 0  # entries that could not be written
        self.damaged = 0  # lines of the last look that are no entries

    def done(self, what: str, who: str, address: str = "", detail: str = "") -> None:
        """Write down what was done."""
        self._write(Entry(time.time(), who, address, what, "done", detail))

    def refused(self, what: str, who: str, address: str = "", detail: str = "") -> None:
        """Write down what was wished and not done. Of very many from one network the 64th, the
        128th ... with their number: a flood of them must not wash the rest out of the file.
        """
        many = self._count(Backoff.network(address))
        if many > EACH:
            if many & (many - 1):
                return
            detail = f"the {many}th refusal from there within {SPAN_S / 60:.0f} min; {detail}"
        self._write(Entry(time.time(), who, address, what, "refused", detail))

    def _count(self, network: str) -> int:
        """Refusals of a network within SPAN_S of the first of them."""
        now = time.monotonic()
        with self._lock:
            since, count = self._refusals.pop(network, (now, 0))
            if now - since > SPAN_S:
                since, count = now, 0
            self._refusals[network] = since, count + 1
            while len(self._refusals) > ADDRESSES:
                self._refusals.pop(next(iter(self._refusals)))
        return count + 1

    def newest(self, number: int, text: str = "") -> list[Entry]:
        """The newest entries that contain every word of `text`, newest first."""
        found, damaged, words = [], 0, text.lower().split()
        for line in reversed(self._tail()):
            try:
                entry = Entry(**json.loads(line))
            except (ValueError, TypeError, RecursionError):
                damaged += 1
                continue
            said = (entry.who, entry.address, entry.what, entry.result, entry.detail)
            inside = " ".join(map(str, said)).lower()
            if all(word in inside for word in words):
                found.append(entry)
                if len(found) == number:
                    break
        self.damaged = damaged
        return found

    def _tail(self) -> list[bytes]:
        lines: list[bytes] = []
        for path in (self.path.with_name(self.path.name + ".1"), self.path):
            try:
                with path.open("rb") as stream:
                    size = stream.seek(0, os.SEEK_END)
                    stream.seek(max(0, size - TAIL))
                    part = stream.read(TAIL).splitlines()
            except OSError:
                continue
            lines += part[1:] if size > TAIL else part
        return [line for line in lines if line.strip()]

    def _write(self, entry: Entry) -> None:
        short = {k: plain(v, TEXT) if isinstance(v, str) else v for k, v in asdict(entry).items()}
        line = json.dumps(short) + "\n"
        said = f"{short['who'] or 'nobody'} {short['result']}: {short['what']} {short['detail']}"
        log.log(
            logging.INFO if entry.result == "done" else logging.WARNING,
            "%s from %s",
            said.strip(),
            entry.address or "this machine",
        )
        with self._lock:
            try:
                self._add(line.encode())
            except OSError as error:
                self.lost += 1
                if self.lost & (self.lost - 1) == 0:
                    log.error("%s: %s: %d entries lost", self.path, error.strerror, self.lost)

    def _add(self, line: bytes) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        handle = os.open(self.path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            if os.fstat(handle).st_size > LARGEST:
                os.replace(self.path, self.path.with_name(self.path.name + ".1"))
                os.close(handle)
                handle = os.open(self.path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
            os.write(handle, line)
        finally:
            os.close(handle)
