"""What a crash left: an open session is rebuilt into a new file, the original stays.

mcap's own reader opened 0 of 100 truncated files, its stream reader read all of them up to the last
complete chunk; so the file is read as a stream, chunk by chunk with CRCs checked, and written anew
with an index.
"""

import logging
import os
import time
from dataclasses import dataclass, field
from pathlib import Path

from inertial.whole_file import sync_folder
from messages.clock import Moment
from messages.contract.topics import Address, parse
from sessions.recording.certificate import Witness, certify
from sessions.recording.keys import KeyState
from sessions.recording.manifest import (
    RECORDING,
    RECOVERED,
    KeyCount,
    Manifest,
    SessionError,
    read_manifest,
    write_manifest,
)
from sessions.recording.mcap_append import McapLog
from sessions.recording.mcap_damage import Damage
from sessions.recording.mcap_log import read
from sessions.recording.store import lock

log = logging.getLogger(__name__)

CHUNK_BYTES = 128 * 1024


@dataclass
class Salvage:
    """What was taken from a damaged file."""

    keys: dict[str, KeyCount]
    channels: dict[int, str]
    damage: Damage
    witness: Witness = field(default_factory=Witness)
    start_utc_ns: int = 0
    end_utc_ns: int = 0
    sha256: str = ""  # of the new file

    @property
    def messages(self) -> int:
        return sum(count.messages for count in self.keys.values())


def salvage(source: Path, target: Path, channels: dict[int, str] | None = None) -> Salvage:
    """Write every readable message of `source` to the new file `target`, in the same order and with
    the same times.

    Raises OSError; a half-written target is removed then.
    """
    part = target.with_suffix(".part")
    fd = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o640)
    try:
        result = _copy(source, fd, channels)
        os.fsync(fd)
        os.replace(part, target)
    except OSError:
        part.unlink(missing_ok=True)
        raise
    finally:
        os.close(fd)
    sync_folder(target.parent)
    return result


def _copy(source: Path, fd: int, channels: dict[int, str] | None) -> Salvage:
    out = McapLog(fd, CHUNK_BYTES)
    states: dict[str, KeyState] = {}
    addresses: dict[str, Address] = {}
    result = Salvage({}, {}, Damage())
    for message in read(source, result.damage, channels):
        state = states.get(message.key)
        if state is None:
            address = parse(message.key)
            state = KeyState(out.open_channel(message.key, address.topic), address)
            states[message.key], addresses[message.key] = state, address
        state.publish_time(message.payload)
        result.witness.look(addresses[message.key], message.payload)
        out.add(
            state.channel, message.log_ns, message.publish_ns, message.payload, state.last_sequence
        )
        result.start_utc_ns = result.start_utc_ns or message.log_ns
        result.end_utc_ns = max(result.end_utc_ns, message.log_ns)
        if out.pending > 4 * CHUNK_BYTES:
            out.push()
    out.finish()
    out.push()
    result.keys = {key: state.count for key, state in states.items()}
    result.channels = out.channels
    result.sha256 = out.sha256
    return result


def recover_session(folder: Path) -> Manifest | None:
    """Recover one open session; None when it is still being recorded by a living process.

    Raises SessionError when session.json cannot be read or the session is not open, OSError when
    the disk refuses.
    """
    manifest = read_manifest(folder)
    if manifest.state != "open":
        raise SessionError(f"{folder}: is {manifest.state}: only an open session needs recovery")
    original = folder / RECORDING
    fd = os.open(original, os.O_RDONLY | os.O_CLOEXEC)
    try:
        if not lock(fd):
            return None
        found = salvage(original, folder / RECOVERED, manifest.channels)
    finally:
        os.close(fd)
    manifest.state, manifest.file = "recovered", RECOVERED
    for (
        key,
        count,
    ) in found.keys.items():  # the file does not tell which of its messages were filled in
        count.repaired = manifest.keys[key].repaired if key in manifest.keys else 0
    manifest.keys, manifest.channels = found.keys, found.channels
    manifest.certificate = {
        device: c.model_dump()
        for device, c in certify(found.keys, found.witness.wire(), manifest.refused).items()
    }
    manifest.provenance = found.witness.provenance() or manifest.provenance
    manifest.devices = sorted({parse(key).device for key in found.keys})
    manifest.start_utc_ns = manifest.start_utc_ns or found.start_utc_ns
    manifest.end_utc_ns = found.end_utc_ns or manifest.start_utc_ns
    manifest.bytes = (folder / RECOVERED).stat().st_size
    manifest.sha256 = found.sha256
    manifest.recovery = (
        f"{found.messages} messages from {original.stat().st_size} bytes of {RECORDING}, which was"
        f" not closed: {'; '.join(filter(None, (str(found.damage), found.damage.others)))}"
    )
    write_manifest(folder, manifest)
    log.warning("%s: recovered %s", manifest.id, manifest.recovery)
    return manifest


def _order(folder: Path) -> tuple[int, str]:
    """Sessions by their numbers; their names are of a clock that may have been set."""
    try:
        return read_manifest(folder).number, folder.name
    except SessionError:
        return 0, folder.name


def cut_off(root: Path, within_s: float, max_bytes: int) -> Path | None:
    """Folder of the newest session, when it is open, was written to within that time, and nobody
    writes it now.
    """
    try:
        newest = max(
            (f for f in root.iterdir() if (f / RECORDING).exists()),
            key=_order,
            default=None,
        )
        if newest is None:
            return None
        manifest = read_manifest(newest)
        if manifest.state != "open":
            return None
        state = (newest / RECORDING).stat()
        written = Moment.of(manifest.written)
        age_s = written.age_s if written is not None else time.time() - state.st_mtime
        if age_s > within_s or state.st_size > max_bytes:
            return None
        fd = os.open(newest / RECORDING, os.O_RDONLY | os.O_CLOEXEC)
    except (SessionError, OSError):
        return None  # recover_all says what is wrong with it
    try:
        return newest if lock(fd) else None
    finally:
        os.close(fd)


def recover_all(root: Path) -> list[Manifest]:
    """Recover every open session below root that nobody records; what cannot be recovered is logged
    and left alone.
    """
    recovered = []
    for folder in sorted(root.iterdir()) if root.is_dir() else []:
        try:
            if (folder / RECORDING).exists() and read_manifest(folder).state == "open":
                manifest = recover_session(folder)
                recovered += [manifest] if manifest else []
        except (SessionError, OSError) as error:
            log.error("recovery: %s", error)
    return recovered
