"""Is a session what it says it is? Its bytes against the hash, its messages against the counts."""

import hashlib
from dataclasses import dataclass, field
from pathlib import Path

from sessions.export.table import Progress, Selection, messages, silent
from sessions.library import curves
from sessions.recording.manifest import KeyCount, Manifest, read_manifest
from sessions.recording.mcap_damage import Damage


@dataclass
class Verification:
    """What was found."""

    session: str
    state: str  # of session.json
    hash_ok: bool | None  # None: an open session has no hash yet
    messages: int  # readable
    counted: int  # by the recorder
    undecodable: int
    damage: str
    others: str = ""  # what other programs wrote into the file
    differing: dict[str, str] = field(default_factory=dict)  # bus key -> what differs
    curves: str = "none"  # kept for drawing: none, stale (made anew when needed) or fresh

    @property
    def ok(self) -> bool:
        """Everything that was recorded is there and can be read."""
        return self.damage == str(Damage()) and self.hash_ok is not False and not self.differing


def verify(folder: Path, progress: Progress = silent) -> Verification:
    """Read a session whole; raises SessionError without a readable session.json, OSError."""
    manifest = read_manifest(folder)
    path = folder / manifest.file
    progress(0.0, "hashing")
    with path.open("rb") as stream:
        hash_ok = (
            hashlib.file_digest(stream, "sha256").hexdigest() == manifest.sha256
            if manifest.sha256
            else None
        )
    damage, found = Damage(), {}
    total = max(1, manifest.messages)
    for count, (row, _, _) in enumerate(messages(path, Selection(), damage)):
        found[row.key] = found.get(row.key, 0) + 1
        if count % 5000 == 0:
            progress(0.1 + 0.9 * min(1.0, count / total), "reading")
    progress(1.0, "read")
    return Verification(
        session=manifest.id,
        state=manifest.state,
        hash_ok=hash_ok,
        messages=sum(found.values()),
        counted=manifest.messages,
        undecodable=damage.undecodable,
        damage=str(damage),
        others=damage.others,
        curves=curves.state(path),
        differing={} if manifest.state == "open" else _differences(manifest, found),
    )


def _differences(manifest: Manifest, found: dict[str, int]) -> dict[str, str]:
    rows = {}
    for key in sorted(manifest.keys.keys() | found.keys()):
        counted, read = manifest.keys.get(key, KeyCount()).messages, found.get(key, 0)
        if counted != read:
            rows[key] = f"{read} messages in the file, {counted} counted when they were recorded"
    return rows
