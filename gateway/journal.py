"""Every raw read goes to disk before anything else looks at it.

A journal is a folder of segment files of one device (journal_file.py says what stands in them). One write per read; a
thread calls fdatasync, which may take half a second and must never hold up the reader. `durable_seq` is what has
reached the disk. Sequence numbers go on over restarts; `run` is new at every start. A tail that a crash has torn is
cut at the next start.
"""

import logging
import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path

from gateway.journal_file import SEGMENT_HEAD, SEGMENT_MAGIC, Record, pack, scan

log = logging.getLogger(__name__)

RETRY_S = 2.0  # after a failed write the next attempt waits this long


class Journal:
    """Journal of one device. `append` may be called from several threads; it never raises.

    While the disk refuses, `message` says why and what to do, `unkept_bytes` counts, and data go on without being kept.
    """

    def __init__(
        self, folder: Path, max_bytes: int = 2 << 30, segment_bytes: int = 4 << 20, sync_s: float = 0.5
    ) -> None:
        self.folder = folder
        self.max_bytes = max_bytes
        self.segment_bytes = segment_bytes
        self.run = time.time_ns()
        self.message = ""
        self.unkept_bytes = 0
        self.cut_bytes = 0
        self.durable_seq = 0
        self.last_seq = 0
        self.max_sync_s = 0.0
        self._lock = threading.Lock()
        self._fd: int | None = None
        self._size = 0
        self._full: list[int] = []  # descriptors of finished segments that still want their fdatasync
        self._retry_at = 0.0
        self._sync_s = sync_s
        self._stop = threading.Event()
        self._recover()
        self._thread = threading.Thread(target=self._sync_loop, name=f"journal-{folder.name}", daemon=True)
        self._thread.start()

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
                    raise OSError(28, "No space left on device")
            except OSError as error:
                self._refuse(error)
                self.unkept_bytes += len(data)
                return 0
            self.last_seq += 1
            self._size += len(raw)
            if self._size >= self.segment_bytes:
                self._finish_segment()
            return self.last_seq

    def close(self) -> None:
        """Sync and close."""
        self._stop.set()
        self._thread.join()
        with self._lock:
            self._finish_segment()
        self._sync()

    def first_kept(self) -> int:
        """Sequence of the oldest record that is still there; last_seq + 1 when there is none."""
        names = self._segments()
        return _first_of(names[0]) if names else self.last_seq + 1

    def history(self, first: int, last: int, max_bytes: int = 4 << 20) -> Iterator[bytes]:
        """Verbatim records first..last that are still kept, in order, until max_bytes are exceeded."""
        names = self._segments()
        total = 0
        for name, following in zip(names, [*names[1:], None], strict=True):
            if _first_of(name) > last:
                return
            if following is not None and _first_of(following) <= first:
                continue
            try:
                data = name.read_bytes()
            except FileNotFoundError:
                continue  # retention was faster
            for start, end, record in scan(data).records:
                if first <= record.sequence <= last:
                    total += end - start
                    yield data[start:end]
                    if total >= max_bytes:
                        return

    # --- segments

    def _segments(self) -> list[Path]:
        return sorted(self.folder.glob("*.gfj"))

    def _recover(self) -> None:
        """Cut torn tails and find the last sequence. A finished segment may wait for its fdatasync: look at two."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            for name in self._segments()[-2:]:
                data = name.read_bytes()
                found = scan(data)
                end = min(found.good_end, len(data))
                if end < len(data):
                    os.truncate(name, end)
                    self.cut_bytes += len(data) - end
                    log.warning("%s: cut a torn tail of %d bytes", name, len(data) - end)
                last = found.records[-1][2].sequence if found.records else _first_of(name) - 1
                self.last_seq = max(self.last_seq, last)
                if not found.records:
                    name.unlink()
            self.durable_seq = self.last_seq
        except OSError as error:
            self._refuse(error)

    def _open_segment(self) -> bool:
        if time.monotonic() < self._retry_at:
            return False
        first = self.last_seq + 1
        name = self.folder / f"{first:020d}.gfj"
        head = SEGMENT_HEAD.pack(SEGMENT_MAGIC, self.run, first)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._fd = os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND | os.O_CLOEXEC, 0o640)
            if os.write(self._fd, head) < len(head):
                raise OSError(28, "No space left on device")
        except OSError as error:
            self._refuse(error)
            return False
        self._size = len(head)
        if self.message:
            log.warning("journal %s: writable again; %d bytes were not kept", self.folder, self.unkept_bytes)
            self.message = ""
        return True

    def _refuse(self, error: OSError) -> None:
        """Cut the half record away, so that what stands in the segment stays readable, and try again later."""
        if self._fd is not None:
            try:
                os.ftruncate(self._fd, self._size)
            except OSError:
                pass  # the next start cuts it
            self._full.append(self._fd)
            self._fd = None
        self._retry_at = time.monotonic() + RETRY_S
        if not self.message:
            remedy = "free some space" if error.errno == 28 else "make the folder writable for this user"
            self.message = f"journal {self.folder}: {error.strerror}; data are shown but NOT KEPT; {remedy}"
            log.error("%s", self.message)

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
            current = None if self._fd is None else os.dup(self._fd)
        start = time.monotonic()
        try:
            for fd in [*full, *([] if current is None else [current])]:
                os.fdatasync(fd)
            self.durable_seq = last
        except OSError as error:
            self.message = f"journal {self.folder}: fdatasync: {error.strerror}; data are NOT SAFE; check the disk"
            log.error("%s", self.message)
        finally:
            for fd in [*full, *([] if current is None else [current])]:
                os.close(fd)
        self.max_sync_s = max(self.max_sync_s, time.monotonic() - start)
        if full:
            self._retain()

    def _retain(self) -> None:
        names = self._segments()
        sizes = [name.stat().st_size for name in names]
        total = sum(sizes)
        for name, size in zip(names[:-1], sizes, strict=False):  # never the newest
            if total <= self.max_bytes:
                return
            name.unlink(missing_ok=True)
            total -= size
            log.info("%s: removed, the journal keeps %d bytes", name, self.max_bytes)


def _first_of(name: Path) -> int:
    return int(name.stem)
