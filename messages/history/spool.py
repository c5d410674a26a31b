"""What a process has published, kept on the disk, so that a consumer which missed something can ask
for it.

A spool is a journal (journal.py) whose records are messages, in the order of publication:

    data = u64 run | u64 header.sequence | i64 header.utc_ns | u8 length of the topic | u8 length of
    the device
           | topic, with its estimator | device | payload

all little-endian. The record's sequence is the message's position, its UTC time the time of
publication. A message stands here before it goes to the bus, also while there is no bus. Questions
and answers are HistoryQuery and HistoryReply; nothing in a payload is looked at or changed.
"""

import logging
import os
import struct
import threading
import time
from collections import deque
from collections.abc import Iterator
from itertools import groupby, zip_longest
from operator import itemgetter
from pathlib import Path

from messages.clock import Clock
from messages.contract import gyrofree_pb2 as pb
from messages.history.journal import Journal
from messages.history.journal_file import (
    MAX_BYTES,
    PUBLISHED,
    RECORD_HEAD,
    RECORD_MAGIC,
    Record,
    unpack_at,
    walk,
)
from messages.history.journal_folder import first_of
from messages.history.spool_file import (
    GLANCE_BYTES,
    HEAD,
    Entry,
    Glance,
    count,
    entry_of,
    older,
    records_in,
)

log = logging.getLogger(__name__)

REPLY_BYTES = 1 << 20  # of one reply; who wants more asks on
OVERVIEW_S = 0.5  # an overview is no finer than this
OVERVIEW_LENGTH_S = 900.0  # and reaches back so far
LATE_S = 5.0  # a message is published at most so long after the time in its header


class Spool:
    """Published messages of one process, or of one device of it. `append` never raises; the journal
    says what fails.

    Raises JournalBusy when another process has the folder.
    """

    def __init__(
        self,
        folder: Path,
        max_bytes: int = 1 << 30,
        max_age_s: float = 7200.0,
        segment_bytes: int = 4 << 20,
    ) -> None:
        self.journal = Journal(folder, max_bytes, segment_bytes, max_age_s=max_age_s)
        self._clock = Clock()
        self._lock = threading.Lock()
        self._runs: dict[
            int, dict[tuple[str, str, int], list[int]]
        ] = {}  # by segment: first and last sequence
        self._glances: dict[tuple[str, str], deque[Glance]] = {}
        self._until = self.journal.last_seq  # what an earlier process wrote
        self._thread = threading.Thread(
            target=self._look_back, name=f"spool-{folder.name}", daemon=True
        )
        self._thread.start()

    def append(
        self, topic: str, device: str, run: int, sequence: int, utc_ns: int, payload: bytes
    ) -> None:
        """Keep one message; one that no reader would take for a record is left out."""
        name, owner = topic.encode(), device.encode()
        if HEAD.size + len(name) + len(owner) + len(payload) > MAX_BYTES:
            log.error("%s/%s: %d bytes are too long to be kept", device, topic, len(payload))
            return
        data = HEAD.pack(run, sequence, utc_ns, len(name), len(owner)) + name + owner + payload
        with self._lock:
            at_ns = self._clock.now_ns()  # like the headers' times: without the wall clock's steps
            if not self.journal.append(PUBLISHED, data, time.monotonic_ns(), at_ns):
                return
            segment, offset = self.journal.place
            if segment not in self._runs:
                self._forget_removed()
            count(self._runs.setdefault(segment, {}), topic, device, run, sequence)
            seen = self._glances.setdefault(
                (topic, device), deque(maxlen=int(OVERVIEW_LENGTH_S / OVERVIEW_S))
            )
            if not seen or abs(utc_ns - seen[-1].utc_ns) >= OVERVIEW_S * 1e9:
                seen.append(Glance(utc_ns, segment, offset))
                while (
                    abs(utc_ns - seen[0].utc_ns) > OVERVIEW_LENGTH_S * 1e9
                ):  # of a rare topic fewer stay
                    seen.popleft()

    def close(self) -> None:
        """Sync and let the folder go."""
        self._thread.join()
        self.journal.close()

    def last_sequences(self) -> dict[tuple[str, str], int]:
        """Largest header.sequence by topic and device, of the newest segments: a publisher goes on
        behind it.
        """
        last: dict[tuple[str, str], int] = {}
        for name in self.journal.segments()[-4:]:
            for (topic, device, _), (_, sequence) in self._summary(name).items():
                last[topic, device] = sequence  # later segments, and later runs in one, overwrite
        return last

    def answer(self, query: pb.HistoryQuery, device: str) -> pb.HistoryReply:
        """What `query` asks of a device; `*` means all of them."""
        reply = pb.HistoryReply(
            durable=self.journal.durable_seq, first_kept=self.journal.first_kept()
        )
        if query.every_s > 0.0:
            entries: Iterator[Entry] = iter(self._overview(query, device))
        else:
            entries = self._entries(query, device)
        size, limit = 0, query.max_bytes or REPLY_BYTES
        for entry in entries:
            if size > limit and query.every_s <= 0.0:
                reply.next = entry.position
                break
            reply.items.add(
                topic=entry.topic,
                run=entry.run,
                sequence=entry.sequence,
                utc_ns=entry.utc_ns,
                published_ns=entry.published_ns,
                payload=entry.payload,
            )
            size += len(entry.payload)
        return reply

    # --- by sequence and time

    def _entries(self, query: pb.HistoryQuery, device: str) -> Iterator[Entry]:
        topics = set(query.topics)
        start = query.position or self._start(query, device)
        if start is None:
            return
        until_ns, until_of = query.until_utc_ns or (1 << 62), query.until_of or query.of
        for entry in self._from(start):
            if device not in ("*", entry.device):
                continue
            if query.until_run and entry.topic == until_of and entry.run == query.until_run:
                if entry.sequence >= query.until_sequence:
                    return
            if entry.published_ns > until_ns + LATE_S * 1e9:
                return
            if topics and entry.topic not in topics:
                continue
            if query.from_utc_ns <= entry.utc_ns <= until_ns:
                yield entry

    def _start(self, query: pb.HistoryQuery, device: str) -> int | None:
        """Position to begin at; None when nothing can be meant."""
        names = self.journal.segments()
        if query.after_run:
            after = self._after(names, (query.of, device, query.after_run), query.after_sequence)
            if after is not None:
                return after
        if query.until_run:
            return self._after(names, (query.until_of or query.of, device, query.until_run), 0)
        if query.after_run:
            return None
        first = 1
        for name in names:  # the last segment that begins before the time
            head = next(iter(records_in(name, limit=1 << 16)), None)
            if head is not None and head.utc_ns > query.from_utc_ns:
                break
            first = first_of(name)
        return first

    def _after(self, names: list[Path], key: tuple[str, str, int], sequence: int) -> int | None:
        """Position behind the last message of `key` not above `sequence`, else of its first; None
        when it has none.
        """
        chosen = None
        for name in reversed(names):
            found = self._summary(name).get(key)
            if found is not None:
                chosen = name
                if found[0] <= sequence:
                    break
            elif chosen is not None or (first_of(name) <= self._until and older(name, key[2])):
                break
        behind = None
        for entry in map(entry_of, records_in(chosen) if chosen else ()):
            if (entry.topic, entry.device, entry.run) == key:
                if entry.sequence > sequence:
                    return entry.position if behind is None else behind
                behind = entry.position + 1
        return behind

    def _from(self, position: int) -> Iterator[Entry]:
        names = self.journal.segments()
        for name, following in zip_longest(names, names[1:]):
            if following is not None and first_of(following) <= position:
                continue
            for record in records_in(name, first=position):
                yield entry_of(record)

    def _summary(self, name: Path) -> dict[tuple[str, str, int], list[int]]:
        """First and last sequence of every topic, device and run in a segment; read once."""
        first = first_of(name)
        with self._lock:
            known = self._runs.get(first)
            if known is not None:
                return dict(known)
        found: dict[tuple[str, str, int], list[int]] = {}
        for record in records_in(name):
            entry = entry_of(record)
            count(found, entry.topic, entry.device, entry.run, entry.sequence)
        with self._lock:
            self._forget_removed()
            return dict(self._runs.setdefault(first, found))

    def _forget_removed(self) -> None:
        kept = self.journal.first_kept()
        for gone in [first for first in self._runs if first < kept]:
            del self._runs[gone]

    # --- overview

    def _overview(self, query: pb.HistoryQuery, device: str) -> list[Entry]:
        """One message of each topic in every_s, oldest first, read where the index says."""
        until_ns, step = query.until_utc_ns or (1 << 62), query.every_s * 1e9
        topics, wanted = set(query.topics), []
        with self._lock:
            for (topic, owner), glances in self._glances.items():
                if device not in ("*", owner) or (topics and topic not in topics):
                    continue
                last = None
                for glance in glances:
                    if not query.from_utc_ns <= glance.utc_ns <= until_ns:
                        continue
                    if last is None or abs(glance.utc_ns - last) >= 0.99 * step:
                        last = glance.utc_ns
                        wanted.append((glance.segment, glance.offset))
        return [entry_of(record) for record in self._read(sorted(wanted))]

    def _read(self, places: list[tuple[int, int]]) -> Iterator[Record]:
        """Single records of many segments, and no more of these than that."""
        for segment, group in groupby(places, key=itemgetter(0)):
            try:
                stream = (self.journal.folder / f"{segment:020d}.gfj").open("rb")
            except FileNotFoundError:
                continue  # retention was faster
            with stream:
                for _, offset in group:
                    data = os.pread(stream.fileno(), GLANCE_BYTES, offset)
                    found = unpack_at(data, 0)
                    if (
                        found is None
                        and len(data) == GLANCE_BYTES
                        and data.startswith(RECORD_MAGIC)
                    ):
                        length = RECORD_HEAD.unpack_from(data)[4]
                        found = unpack_at(
                            os.pread(
                                stream.fileno(), GLANCE_BYTES + min(length, MAX_BYTES), offset
                            ),
                            0,
                        )
                    if found is not None:
                        yield found[0]

    def _look_back(self) -> None:
        """Find for the overview what an earlier process wrote; beside the work, for it may take a
        second.
        """
        try:
            found: dict[tuple[str, str], list[Glance]] = {}
            since = time.time() - OVERVIEW_LENGTH_S
            for name in self.journal.segments():
                if first_of(name) > self._until or name.stat().st_mtime < since:
                    continue
                for start, _, record in walk(name.read_bytes()):
                    entry = entry_of(record)
                    seen = found.setdefault((entry.topic, entry.device), [])
                    if entry.position <= self._until and (
                        not seen or abs(entry.utc_ns - seen[-1].utc_ns) >= OVERVIEW_S * 1e9
                    ):
                        seen.append(Glance(entry.utc_ns, first_of(name), start))
            with self._lock:
                for key, seen in found.items():
                    length = int(OVERVIEW_LENGTH_S / OVERVIEW_S)
                    self._glances[key] = deque([*seen, *self._glances.get(key, ())], maxlen=length)
        except (OSError, struct.error) as error:
            log.warning(
                "spool %s: no overview of what was published before this start: %s",
                self.journal.folder,
                error,
            )
