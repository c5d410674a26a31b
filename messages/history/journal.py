"""An append-only folder of segment files: what is given to it is kept before anything else happens
with it.

The gateway journals every raw read of a board with it, and gateway and estimator what they publish
(spool.py). journal_file.py says what stands in a segment. One write per record; a thread calls
fdatasync, which may take half a second and must never hold up the writer. `durable_seq` is what has
reached the disk. Sequence numbers go on over restarts; `run` grows with each. A tail that a
crash has torn is cut at the next start. A lock on the file `lock` in the folder keeps a second
gateway out; the system frees it when the process ends, however that happens.
"""

import errno
import logging
import os
import threading
import time
from collections.abc import Iterator
from itertools import zip_longest
from pathlib import Path

from messages.history import journal_folder as on_disk
from messages.history.journal_file import (
    RECORD_MAGIC,
    SEGMENT_HEAD,
    SEGMENT_MAGIC,
    Record,
    last_whole,
    pack,
    scan,
    walk,
)
from messages.history.journal_folder import JournalBusy, end_of, first_of

log = logging.getLogger(__name__)

RETRY_S = 2.0  # after a failed write the next attempt waits this long


class Journal:
    """Journal of one device. `append` may be called from several threads; it never raises.

    While the disk refuses, `message` says why and what to do, `unkept_bytes` counts, and data go on
    without being kept. Raises JournalBusy when another Journal, of this or another process, has the
    folder.
    """

    def __init__(
        self,
        folder: Path,
        max_bytes: int = 2 << 30,
        segment_bytes: int = 4 << 20,
        sync_s: float = 0.25,
        max_age_s: float = 0.0,
    ) -> None:
        """Finished segments are removed, oldest first, above max_bytes and when older than
        max_age_s (0: any age).
        """
        self.folder = folder
        self.max_bytes = max_bytes
        self.max_age_s = max_age_s
        self.segment_bytes = segment_bytes
        self.run = time.time_ns()
        self.unkept_bytes = self.cut_bytes = 0
        self.durable_seq = 0
        self.last_seq = 0
        self._write_message = ""
        self._sync_message = ""
        self._slow_message = ""
        self.place = (0, 0)  # of the last record: first sequence of its segment, offset in it
        self._lock = threading.Lock()
        # descriptor of the locked file; None: the folder could not be used yet
        self._folder_lock: int | None = None
        self._fd: int | None = None
        self._size = self._first = 0  # of the open segment: bytes, sequence of its first record
        self._full: list[int] = []  # finished segments that still want their fdatasync
        self._retry_at = 0.0
        self._sync_s = sync_s
        self._stop = threading.Event()
        self._ages = on_disk.Ages()
        try:
            self._recover()
        except JournalBusy:
            raise
        except OSError as error:
            self._refuse(error)
        self._thread = threading.Thread(
            target=self._sync_loop, name=f"journal-{folder.name}", daemon=True
        )
        self._thread.start()

    @property
    def message(self) -> str:
        """What is wrong with the disk, with the remedy; "" when nothing is."""
        wrong = self._write_message, self._sync_message, self._slow_message
        return "; ".join(filter(None, wrong))

    def append(self, channel: int, data: bytes, monotonic_ns: int, utc_ns: int) -> int:
        """Append one read; its sequence, or 0 when the disk refused it."""
        with self._lock:
            if self._fd is None and not self._open_segment():
                self.unkept_bytes += len(data)
                return 0
            raw = pack(Record(self.last_seq + 1, monotonic_ns, utc_ns, channel, data))
            try:
                written = os.write(self._fd, raw)
                if written < len(raw):  # what a full disk does first
                    raise OSError(errno.ENOSPC, "No space left on device")
            except OSError as error:
                self._refuse(error)
                self.unkept_bytes += len(data)
                return 0
            self.last_seq += 1
            self.place = (self._first, self._size)
            self._size += len(raw)
            if self._size >= self.segment_bytes:
                self._finish_segment()
            return self.last_seq

    def outrun(self, run: int) -> None:
        """Our run is above this one, whatever the wall clock says; the folder remembers it."""
        self.run = max(self.run, run + 1)
        on_disk.keep_run(self.folder, self.run)

    def close(self) -> None:
        """Sync, close and let the folder go."""
        self._stop.set()
        self._thread.join()
        with self._lock:
            self._finish_segment()
        self._sync()
        if self._folder_lock is not None:
            os.close(self._folder_lock)
            self._folder_lock = None

    def first_kept(self) -> int:
        """Sequence of the oldest record that is still there; last_seq + 1 when there is none."""
        names = self.segments()
        return first_of(names[0]) if names else self.last_seq + 1

    def history(self, first: int, last: int, max_bytes: int = 4 << 20) -> Iterator[bytes]:
        """Verbatim records first..last that are still kept, in order, until max_bytes are
        exceeded.
        """
        names = self.segments()
        total = 0
        for name, following in zip_longest(names, names[1:]):
            if first_of(name) > last:
                return
            if following is not None and first_of(following) <= first:
                continue
            try:
                data = name.read_bytes()
            except FileNotFoundError:
                continue  # retention was faster
            for start, end, record in walk(data, first=first):
                if record.sequence > last:
                    return
                total += end - start
                yield data[start:end]
                if total >= max_bytes:
                    return

    def tail(self, max_bytes: int) -> list[Record]:
        """The newest records, oldest first: those in the last max_bytes of the segments."""
        found: list[Record] = []
        for name in reversed(self.segments()):
            data = end_of(name, max_bytes)
            whole = data.startswith(SEGMENT_MAGIC)
            good = scan(
                data, SEGMENT_HEAD.size if whole else max(0, data.find(RECORD_MAGIC))
            ).records
            found = [record for _, _, record in good] + found
            max_bytes -= len(data)
            if max_bytes <= 0:
                break
        return found

    # --- segments

    def segments(self) -> list[Path]:
        """Segment files, oldest first."""
        return sorted(self.folder.glob("*.gfj"))

    def _recover(self) -> None:
        """Lock the folder, cut torn tails and find the last sequence. Raises OSError, JournalBusy
        among them.

        A finished segment may wait for its fdatasync: look at two. One that ends with a whole
        record has no torn tail; reading all of it would take a second in which the board is not
        read.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        lock = on_disk.lock_folder(self.folder)
        try:
            for name in self.segments()[-2:]:
                last = last_whole(end_of(name))
                if last is not None:
                    self.last_seq = max(self.last_seq, last)
                    continue
                data = name.read_bytes()
                found = scan(data)
                end = min(found.good_end, len(data))
                if end < len(data):
                    os.truncate(name, end)
                    self.cut_bytes += len(data) - end
                    log.warning("%s: cut a torn tail of %d bytes", name, len(data) - end)
                last = found.records[-1][2].sequence if found.records else first_of(name) - 1
                self.last_seq = max(self.last_seq, last)
                if not found.records:
                    name.unlink()
        except OSError:
            os.close(lock)
            raise
        self.durable_seq = self.last_seq
        self._folder_lock = lock
        self.outrun(on_disk.newest_run(self.folder))

    def _open_segment(self) -> bool:
        if time.monotonic() < self._retry_at:
            return False
        try:
            if (
                self._folder_lock is None
            ):  # the start found no usable folder: what does it hold now?
                self._recover()
        except OSError as error:
            self._refuse(error)
            return False
        first = self.last_seq + 1
        name = self.folder / f"{first:020d}.gfj"
        head = SEGMENT_HEAD.pack(SEGMENT_MAGIC, self.run, first)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._fd = os.open(
                name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND | os.O_CLOEXEC, 0o640
            )
            if os.write(self._fd, head) < len(head):
                raise OSError(errno.ENOSPC, "No space left on device")
        except OSError as error:
            self._refuse(error)
            return False
        self._size, self._first = len(head), first
        if self._write_message:
            log.warning(
                "journal %s: writable again; %d bytes were not kept", self.folder, self.unkept_bytes
            )
            self._write_message = ""
        return True

    def _refuse(self, error: OSError) -> None:
        """Cut the half record away, so that what stands in the segment stays readable, and try
        again later.
        """
        if self._fd is not None:
            try:
                os.ftruncate(self._fd, self._size)
            except OSError:
                pass  # the next start cuts it
            self._full.append(self._fd)
            self._fd = None
        self._retry_at = time.monotonic() + RETRY_S
        if not self._write_message:
            remedy = on_disk.remedy_of(error)
            self._write_message = (
                f"journal {self.folder}: {error.strerror}; data are shown but NOT KEPT; {remedy}"
            )
            log.error("%s", self._write_message)

    def _finish_segment(self) -> None:
        if self._fd is not None:
            self._full.append(self._fd)
            self._fd = None

    # --- durability and retention, on their own thread

    def _sync_loop(self) -> None:
        while not self._stop.wait(self._sync_s):
            self._sync()

    def _sync(self) -> None:
        with self._lock:
            if self.last_seq == self.durable_seq and not self._full:
                return
            last, full = self.last_seq, self._full
            self._full = []
            files = [*full, *([] if self._fd is None else [os.dup(self._fd)])]
        if not files:
            return  # the files of a failed sync are closed: only a sync of later data can succeed
        start = time.monotonic()
        failure = None
        for fd in files:
            try:
                os.fdatasync(fd)
            except OSError as error:
                failure = error
            finally:
                os.close(fd)
        self._say_synced(last, failure)
        self._slow_message = on_disk.slow(self.folder, time.monotonic() - start)
        if full:
            self._retain()

    def _say_synced(self, last: int, failure: OSError | None) -> None:
        if failure is not None:
            why = f"fdatasync: {failure.strerror}; data are NOT SAFE; check the disk"
            message = f"journal {self.folder}: {why}"
            if message != self._sync_message:
                log.error("%s", message)
            self._sync_message = message
            return
        if self._sync_message:
            # The kernel reports a failed write-back once and drops the pages: these may be gone
            # after a power cut.
            log.warning(
                "journal %s: the disk takes data again; records %d to %d may have holes after a"
                " power cut",
                self.folder,
                self.durable_seq + 1,
                last,
            )
            self._sync_message = ""
        self.durable_seq = last

    def _retain(self) -> None:
        for name in on_disk.superfluous(
            self.segments(), self.max_bytes, self.max_age_s, self._ages
        ):
            name.unlink(missing_ok=True)
            log.info("%s: removed, the journal keeps %d bytes", name, self.max_bytes)
