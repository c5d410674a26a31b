"""One session being recorded: its MCAP file, its session.json, and the thread that makes both
survive a power cut.

The owner calls `add` and, at least every half second, `flush`; both only touch memory and the page
cache. fdatasync took up to 464 ms on the measured disk, so it runs in a thread of its own, every
`sync_s`.
"""

import contextlib
import fcntl
import logging
import os
import platform
import shutil
import threading
import time
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from inertial import core
from inertial.whole_file import sync_folder
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import Address, TopicError, parse
from messages.history.journal_folder import slow
from sessions.recording.certificate import Witness, certify
from sessions.recording.keys import KeyState
from sessions.recording.manifest import (
    RECORDING,
    Manifest,
    next_number,
    write_manifest,
)
from sessions.recording.mcap_append import McapLog
from sessions.recording.settings import RecorderSettings

log = logging.getLogger(__name__)


class AnotherDisk(OSError):
    """What is written to is not what stands in the session's folder any more: the disk was mounted
    anew under it.
    """


LATEST_NS = (1 << 63) - 1
MANIFEST_EVERY_S = 5.0  # counts in session.json of an open session are at most this old


def versions() -> dict[str, str]:
    """Versions of what made a recording; `core` is the digest of the estimators' hot loops."""
    found = {"python": platform.python_version(), "core": core.VERSION}
    for name in ("gyrofree", "eclipse-zenoh", "mcap", "protobuf"):
        with contextlib.suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def lock(fd: int) -> bool:
    """Mark a recording as being written by this process; False when another one has it."""
    for again in (True, True, False):  # a reader that looks has it for a moment
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        except BlockingIOError:
            if again:
                time.sleep(0.01)
    return False


class SessionStore:
    """An open session. Made by `start`; every method is for the owner's thread, the sync thread is
    inside.
    """

    def __init__(self, folder: Path, settings: RecorderSettings, manifest: Manifest) -> None:
        """Make the folder and begin its file; raises OSError (exists, no room, no permission)."""
        folder.mkdir(parents=True, exist_ok=False)
        self.folder = folder
        self.manifest = manifest
        self.durable_messages = 0
        self._write_error = self._sync_error = ""
        self.astray = (
            ""  # says so where what is written goes into a file that nobody finds any more
        )
        self._settings = settings
        self._keys: dict[str, KeyState] = {}
        self._witness = Witness()
        self._addresses: dict[str, Address] = {}
        self._accepted = self._pushed = (
            0  # messages added; of those, handed to the operating system
        )
        self._fd = os.open(
            folder / RECORDING, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o640
        )
        try:
            lock(self._fd)
            self._log = McapLog(self._fd, settings.chunk_bytes, folder)
            self._log.push()
            write_manifest(folder, manifest)
            sync_folder(folder.parent)
        except OSError:
            os.close(self._fd)
            shutil.rmtree(
                folder, ignore_errors=True
            )  # made above, nothing in it yet: no heap of empty sessions
            raise
        self._last_ns = manifest.start_utc_ns  # receive time of the last message, ns since 1970
        self._stop, self._news = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._sync_loop, name="sync", daemon=True)
        self._thread.start()

    @property
    def error(self) -> str:
        """What the disk refuses and what to do; empty when all is well."""
        return self._write_error or self._sync_error

    @property
    def size(self) -> int:
        """Bytes of the file so far, with what is pending."""
        return self._log.size

    @property
    def seconds(self) -> float:
        """Start to last message, s."""
        return max(0.0, (self._last_ns - self.manifest.start_utc_ns) / 1e9)

    @property
    def messages(self) -> int:
        """Messages accepted so far."""
        return self._accepted

    def lost(self) -> dict[str, int]:
        """Messages missing so far by jumps of header.sequence, per key."""
        return {key: state.lost for key, state in self._keys.items()}

    def repaired(self) -> dict[str, int]:
        """Messages filled in so far, per key."""
        return {key: state.repaired for key, state in self._keys.items() if state.repaired}

    def add(self, received_ns: int, key: str, payload: bytes, late: bool = False) -> None:
        """Record one message; `late`: it was filled in.

        Unknown keys and messages beyond max_pending_bytes are counted, not kept.
        """
        state = self._keys.get(key) or self._open_key(key)
        if state is None:
            return
        if self._log.pending > self._settings.max_pending_bytes:
            self.manifest.overflow += 1
            return
        publish_ns = state.publish_time(payload, late) or received_ns
        if not (0 < received_ns < LATEST_NS and 0 < publish_ns < LATEST_NS):
            received_ns = min(max(received_ns, 0), LATEST_NS)  # what the file's format can hold
            publish_ns = received_ns
        self._log.add(state.channel, received_ns, publish_ns, payload, state.last_sequence)
        self._witness.look(self._addresses[key], payload)
        self._accepted += 1
        self._last_ns = max(self._last_ns, received_ns)

    def _open_key(self, key: str) -> KeyState | None:
        if key not in self._keys:
            try:
                address = parse(key)
            except TopicError as error:
                self.manifest.unknown += 1
                if self.manifest.unknown == 1:
                    log.warning("%s: not recorded: %s", self.manifest.id, error)
                return None
            else:
                if not address.topic.recorded:
                    return None
                self._addresses[key] = address
                self._keys[key] = KeyState(self._log.open_channel(key, address.topic), address)
        return self._keys[key]

    def flush(self) -> None:
        """Close the running chunk and hand it to the operating system; a refusal is kept in
        `error`. Raises AnotherDisk where writing again would never help.
        """
        self._log.close_chunk()
        try:
            self._log.push()
        except OSError as error:
            self._fail("writing", error)
            if self._place() == "another":
                text = f"{self.folder}: its disk was mounted anew: beginning anew"
                raise AnotherDisk(text) from None
            return
        if self._place() != "ours":
            self.astray = f"{self.folder} was deleted or moved: what it held is not here any more"
            log.error("%s", self.astray)
        self._pushed = self._accepted
        self._news.set()
        self.manifest.bytes = self._log.size
        self._write_error = ""

    def _place(self) -> str:
        """What stands where the recording should: "ours"; "another" where a disk was mounted anew,
        as one that failed takes nothing for ever from who had its files open; or "nothing".
        """
        try:
            there, ours = os.stat(self.folder / RECORDING), os.fstat(self._fd)
        except OSError:
            return "nothing"
        same = (there.st_dev, there.st_ino) == (ours.st_dev, ours.st_ino)
        return "ours" if same else "another"

    def _fail(self, what: str, error: OSError) -> None:
        text = (
            f"{self.folder}: {what}: {error.strerror}: {self._log.pending} bytes wait in memory; "
            "make room or remount the disk writable, recording then goes on"
        )
        if not self._write_error:
            log.error("%s", text)
        self._write_error = text

    def _snapshot(self) -> Manifest:
        """session.json as it should stand now."""
        known = self._keys.copy()
        self.manifest.end_utc_ns = self._last_ns
        self.manifest.keys = {key: state.count for key, state in known.items()}
        self.manifest.channels = {state.channel: key for key, state in known.items()}
        self.manifest.devices = sorted({state.device for state in known.values()})
        sources = set().union(*(state.sources.copy() for state in known.values()))
        self.manifest.sources = sorted(
            pb.Source.Name(s).removeprefix("SOURCE_") for s in sources if s in _SOURCES
        )
        self.manifest.provenance = self._witness.provenance()
        self.manifest.certificate = {
            device: found.model_dump()
            for device, found in certify(
                self.manifest.keys, self._witness.wire(), self.manifest.refused
            ).items()
        }
        return self.manifest.model_copy()

    def _sync_loop(self) -> None:
        keys, told = 0, time.monotonic()
        while not self._stop.is_set():
            self._news.wait(
                self._settings.sync_s
            )  # what was handed over is made safe at once: a cut may cost a second
            self._news.clear()
            pushed = self._pushed
            began = time.monotonic()
            try:
                os.fdatasync(self._fd)
                self.durable_messages = pushed
                self._sync_error = slow(self.folder, time.monotonic() - began)
                if len(self._keys) != keys or time.monotonic() - told > MANIFEST_EVERY_S:
                    keys, told = len(self._keys), time.monotonic()
                    write_manifest(self.folder, self._snapshot())
            except OSError as error:
                if not self._sync_error:
                    log.error("%s: sync: %s", self.folder, error.strerror)
                self._sync_error = (
                    f"{self.folder}: sync: {error.strerror}: the disk does not keep what is written"
                )

    def close(self) -> bool:
        """End the file and write its hash; False when the disk refuses: the session stays open, to
        be recovered.
        """
        self._stop.set()
        self._news.set()
        self._thread.join()
        try:
            self._log.close_chunk()
            self._log.finish()
            self._log.push()
            os.fsync(self._fd)
            self.manifest.bytes = self._log.size
            self.manifest.sha256 = self._log.sha256
            self.manifest.state = "closed"
            write_manifest(self.folder, self._snapshot())
        except OSError as error:
            self._fail("closing", error)
            return False
        finally:
            os.close(self._fd)
        self.durable_messages = self._accepted
        return True


_SOURCES = frozenset(pb.Source.values())


def start(
    settings: RecorderSettings,
    now_ns: int | None = None,
    *,
    name: str = "",
    note: str = "",
    user: str = "",
    continues: str = "",
    configuration: dict[str, object] | None = None,
) -> SessionStore:
    """Begin a session now; its id is the UTC time and the name. now_ns: by the clock of its receive
    times. Raises OSError when the root cannot be written.
    """
    now = time.time_ns() if now_ns is None else now_ns
    stamp = time.strftime("%Y%m%d-%H%M%S", time.gmtime(now // 1_000_000_000))
    base = f"{stamp}-{name}" if name else stamp
    for attempt in range(100):
        session = base if not attempt else f"{base}-{attempt + 1}"
        manifest = Manifest(
            id=session,
            note=note,
            user=user,
            continues=continues,
            number=next_number(settings.root),
            start_utc_ns=now,
            end_utc_ns=now,
            versions=versions(),
            configuration=configuration or {},
        )
        try:
            return SessionStore(settings.root / session, settings, manifest)
        except FileExistsError:
            continue
    raise FileExistsError(17, "a hundred sessions of one second", str(settings.root))
