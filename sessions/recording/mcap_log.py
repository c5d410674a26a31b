"""The one reader of MCAP, front to end: ours and other writers', with chunks or without, cut off or
damaged anywhere.

Frames of records are read here, for a length beyond the file's end, a byte too few or an unknown
compression must end in an account and not in a shorter message; what is inside them is parsed by
the mcap library (https://mcap.dev/spec). Nothing here looks into a payload.
"""

import fcntl
import functools
import io
import logging
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from mcap.opcode import Opcode
from mcap.records import Channel, DataEnd, Footer, Schema, Statistics

from sessions.recording.mcap_damage import Damage
from sessions.recording.mcap_index import keys_of, summary_of
from sessions.recording.mcap_records import (
    BLOCK,
    MESSAGE,
    RECORD,
    RECORD_LIMIT,
    SUMMARY_CRC,
    Names,
    Unreadable,
    content,
    crc_of,
    parsed,
    records,
)
from sessions.recording.mcap_writer import MAGIC

READ = (
    Opcode.CHUNK,
    Opcode.MESSAGE,
    Opcode.SCHEMA,
    Opcode.CHANNEL,
    Opcode.DATA_END,
    Opcode.STATISTICS,
    Opcode.FOOTER,
)

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Recorded:
    """One message as it crossed the bus."""

    log_ns: int  # when the recorder received it, UTC, ns since 1970
    publish_ns: int  # header.utc_ns, or log_ns when it has none
    key: str
    payload: bytes


def read(
    path: Path, damage: Damage | None = None, channels: dict[int, str] | None = None
) -> Iterator[Recorded]:
    """Every readable message of this program in the order of recording, also of a file without an
    end; CRCs are checked.

    `channels` (of session.json) names channels whose declaration is in a damaged chunk. What could
    not be read is counted in `damage`; a caller that gives none has it logged. Raises OSError.
    """
    found = Damage() if damage is None else damage
    with path.open("rb") as stream:
        yield from _Reading(path, stream, found, channels or {}).messages()
    if damage is None:
        say(path, found)


def say(path: Path, damage: Damage) -> None:
    """Log what is wrong with a file, once for each state of it."""
    state = path.stat()
    _say(path, state.st_size, state.st_mtime_ns, tuple(damage.said()))


@functools.lru_cache(maxsize=256)
def _say(path: Path, size: int, mtime_ns: int, said: tuple[str, ...]) -> None:
    for text in said:
        log.warning("%s: %s", path, text)


class _Reading:
    """One file, front to end."""

    def __init__(
        self, path: Path, stream: IO[bytes], damage: Damage, channels: dict[int, str]
    ) -> None:
        self._path: Path | None = path  # until its index has been asked for names
        self._stream, self._damage = stream, damage
        self._names = Names(channels)
        self._crc = self._before_record = 0  # of all bytes; of those before the running record
        self._at = 0  # byte at which the running record begins
        self._summary_at = 0  # byte behind the data section
        self._counted: int | None = None  # messages by the file's statistics

    def messages(self) -> Iterator[Recorded]:
        """All that can be read; the damage is counted."""
        damage = self._damage
        start = self._stream.read(len(MAGIC))
        self._crc = zlib.crc32(start)
        if start != MAGIC:
            damage.tail = "it is empty" if not start else "it does not begin as an MCAP file does"
            return
        while (head := self._head()) is not None:
            opcode, length = head
            if opcode in READ and length <= RECORD_LIMIT:
                body = self._take(length)
                if len(body) < length:
                    damage.tail = self._cut()
                    return
                yield from self._record(opcode, body)
                if opcode == Opcode.FOOTER:
                    self._end()
                    return
            elif not self._pass_over(opcode, length):
                damage.tail = self._cut()
                return

    def _head(self) -> tuple[int, int] | None:
        self._at, self._before_record = self._stream.tell(), self._crc
        head = self._take(RECORD.size)
        if len(head) < RECORD.size:
            self._damage.tail = self._cut()
            return None
        return RECORD.unpack(head)

    def _take(self, length: int) -> bytes:
        data = self._stream.read(length)
        self._crc = zlib.crc32(data, self._crc)
        return data

    def _cut(self) -> str:
        end = self._stream.seek(0, io.SEEK_END)
        self._damage.growing = _is_written(self._stream.fileno())
        if self._at == end:
            return f"ends at byte {end} without a close"
        return f"cut off or damaged from byte {self._at} of {end} on"

    def _pass_over(self, opcode: int, length: int) -> bool:
        """Leave a record out; False where the file ends within it."""
        self._damage.oversized += opcode in READ
        while length:
            data = self._take(min(length, BLOCK))
            if not data:
                return False
            length -= len(data)
        return True

    def _record(self, opcode: int, body: bytes) -> Iterator[Recorded]:
        try:
            if opcode == Opcode.CHUNK:
                yield from self._chunk(body)
            elif opcode == Opcode.MESSAGE:
                yield from self._message(body, False)
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                if not self._summary_at:
                    self._declare(opcode, body)
            else:
                self._close(opcode, body)
        except Unreadable as error:
            log.debug("record at byte %d: %s", self._stream.tell() - len(body), error)
            if opcode == Opcode.CHUNK:
                self._damage.chunks += 1
            elif self._summary_at:
                self._damage.index = True
            else:
                self._damage.records += 1

    def _chunk(self, body: bytes) -> Iterator[Recorded]:
        data, checked = content(body)
        for opcode, begin, end in records(data):
            if opcode == Opcode.MESSAGE:
                yield from self._message(data[begin:end], checked)
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._declare(opcode, data[begin:end])

    def _declare(self, opcode: int, body: bytes) -> None:
        if opcode == Opcode.SCHEMA:
            self._names.schema(parsed(Schema, body))
        else:
            self._names.channel(parsed(Channel, body))

    def _message(self, body: bytes, checked: bool) -> Iterator[Recorded]:
        if len(body) < MESSAGE.size:
            raise Unreadable("a message without a head")
        channel, _, log_ns, publish_ns = MESSAGE.unpack_from(body)
        self._damage.messages += 1
        self._damage.unchecked += not checked
        if channel not in self._names and self._path is not None:
            index, self._path = summary_of(self._path), None
            self._names.add(keys_of(index) if index is not None else {})
        key = self._names.keys.get(channel)
        if key is not None:
            yield Recorded(log_ns, publish_ns, key, body[MESSAGE.size :])
        elif channel in self._names.foreign:
            foreign, name = self._damage.foreign, self._names.foreign[channel]
            foreign[name] = foreign.get(name, 0) + 1
        else:
            self._damage.orphans += 1

    def _close(self, opcode: int, body: bytes) -> None:
        if opcode == Opcode.DATA_END:
            told = parsed(DataEnd, body).data_section_crc
            if told and told != self._before_record:
                self._damage.checksum = True
            elif told:
                self._damage.unchecked = 0
            self._summary_at = self._stream.tell()
        elif opcode == Opcode.STATISTICS:
            self._counted = parsed(Statistics, body).message_count
        else:
            self._foot(parsed(Footer, body))

    def _foot(self, footer: Footer) -> None:
        if footer.summary_start not in (0, self._summary_at):
            self._damage.index = True
        elif footer.summary_start and footer.summary_crc:
            end = self._stream.tell()
            told = crc_of(self._stream, self._summary_at, end - SUMMARY_CRC)
            self._damage.index |= told != footer.summary_crc
            self._stream.seek(end)

    def _end(self) -> None:
        damage = self._damage
        if self._stream.read(len(MAGIC)) != MAGIC:
            damage.tail = self._cut()
        elif behind := len(self._stream.read(1)):
            rest = behind - self._stream.tell() + self._stream.seek(0, io.SEEK_END)
            damage.tail = f"{rest} bytes behind its end are not read"
        if self._counted is not None and not damage.index:
            damage.missing = max(0, self._counted - damage.messages)


def _is_written(fd: int) -> bool:
    """Does a recorder have this file (store.lock)?"""
    try:
        fcntl.flock(fd, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:  # a file system without locks
        return False
    fcntl.flock(fd, fcntl.LOCK_UN)
    return False
