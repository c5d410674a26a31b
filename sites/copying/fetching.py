"""The other end of copying: ask for what differs, and prove that nothing does any more.

The newest session comes first: what people look at. A file is written beside its place and put
there when its hash is home's; session.json comes last, so a session is in the library once it is
whole. Stopped anywhere, the copy goes on where it was: what is on the disk is hashed, not believed.
"""

import datetime as dt
import hashlib
import json
import logging
import os
from collections.abc import Callable, Iterator
from pathlib import Path

from pydantic import ValidationError

from inertial.whole_file import put_in_place
from sessions.library.copied import Copied, Hashes, write_copied
from sites.copying.gathering import Drafts, Gathering, Segment
from sites.copying.roads import Ask, Ways
from sites.copying.shelf import FILE, SEGMENT, SESSION, Listed, Listing, list_file
from sites.copying.since import Heard
from sites.place import SiteError, write

PART = ".part"
BOOK = "copies.json"
LAST = "session.json"
INDEX = "index"  # asks for the sessions that there are
LARGEST = 64 << 20  # bytes of a list
UNREADABLE = "home's list of segments cannot be read: is it of another version?"

log = logging.getLogger(__name__)


class Copies:
    """What a place has of home's sessions."""

    def __init__(self, root: Path, folder: Path, home: str = "home", here: str = "here") -> None:
        """root: of the sessions here; folder: of the place, where the proof is kept; home, here:
        names of the two places.
        """
        self._root, self._book, self._names = root, folder / BOOK, (home, here)
        self._heard, self._drafts = Heard(), Drafts()
        self._small: dict[str, bytes] = {}  # session.json of open sessions, by sha256
        self.known: dict[str, dict] = load_copies(folder)

    def round(self, ways: Ways, stop: Callable[[], bool]) -> int:
        """Copy what is new or has changed, on all ways at once; how many sessions became equal.
        Raises SiteError when home does not answer, OSError when nothing can be written here.
        """
        there, count = _index(self._ask(INDEX, ways)), 0
        for session in sorted(there, reverse=True):
            if stop():
                break
            if self.known.get(session, {}).get("stamp") == there[session]:
                continue
            proof = self._session(session, ways, stop)
            if proof is not None:
                self._prove(session, there[session], proof)
                log.info("%s: the copy is equal to home's", session)
                count += 1
        return count

    def _prove(self, session: str, stamp: str, proof: dict[str, dict[str, str]]) -> None:
        """Into the session's folder, for who looks at it, and into the book."""
        now = dt.datetime.now(dt.UTC).replace(microsecond=0)
        home, here = self._names
        files = {name: Hashes(**hashes) for name, hashes in proof.items()}
        copied = Copied(home=home, here=here, equal_since=now, files=files)
        write_copied(self._root / session, copied)
        self.known[session] = {"stamp": stamp, "equal_since": now.isoformat(), "files": proof}
        write(self._book, json.dumps(self.known, indent=1).encode() + b"\n", 0o644)

    def _ask(self, what: str, ways: Ways) -> bytes:
        """What may be long, and changes a little."""
        try:
            return self._heard.asked(what, ways()[0])
        except SiteError:
            raise
        except ValueError:
            raise SiteError(UNREADABLE) from None

    def _session(self, session: str, ways: Ways, stop: Callable[[], bool]) -> dict | None:
        """By file home's hash and the one here; None while it has not come to its end."""
        listing = _listing(self._ask(session, ways))
        recording = self._open(listing, session, ways()[0])
        folder = self._root / session
        folder.mkdir(parents=True, exist_ok=True)
        proof = {}
        for name in sorted(listing.files, key=lambda name: (name == LAST, name)):
            if recording and name == LAST:
                return None
            wanted, path = listing.files[name], folder / name
            if name == LAST and wanted.sha256 in self._small:  # it need not come twice
                _part(path).write_bytes(self._small[wanted.sha256])
            if recording:
                wanted = _full(wanted)  # its end changes with every message
            if not self._file(path, wanted, ways, stop):
                return None
            if recording:
                continue
            here = list_file(_part(path))
            if here.sha256 != wanted.sha256:
                log.warning("%s/%s changed at home meanwhile: once more", session, name)
                return None
            put_in_place(_part(path), path)
            proof[name] = {"home_sha256": wanted.sha256, "here_sha256": here.sha256}
        return proof

    def _open(self, listing: Listing, session: str, ask: Ask) -> bool:
        """Is this session still being recorded? What says so is asked for when it has changed."""
        if LAST not in listing.files:
            return True
        listed = listing.files[LAST]
        if listed.sha256 not in self._small:
            pieces = [
                ask(f"{session}/{LAST}/{number * SEGMENT}-{sha256}")
                for number, sha256 in enumerate(listed.segments)
            ]
            self._small = {listed.sha256: b"".join(pieces)}
        try:
            return json.loads(self._small[listed.sha256]).get("state") == "open"
        except (ValueError, AttributeError):
            return True

    def _file(self, path: Path, wanted: Listed, ways: Ways, stop: Callable[[], bool]) -> bool:
        """Bring the draft of a file to what home has; False when `stop` came first."""
        part = _part(path)
        if not part.exists() and path.exists():
            part.write_bytes(path.read_bytes())
        descriptor = os.open(part, os.O_RDWR | os.O_CREAT, 0o644)
        with os.fdopen(descriptor, "r+b") as stream:
            stream.truncate(min(os.fstat(descriptor).st_size, wanted.size))

            def keep(segment: Segment, content: bytes) -> bool:
                if hashlib.sha256(content).hexdigest() != segment.sha256:
                    log.info("%s: a segment changed while it was fetched", path.name)
                    return False
                stream.seek(segment.first)
                stream.write(content)
                return True

            name = f"{path.parent.name}/{path.name}"
            missing = _missing(stream, wanted)
            whole = Gathering(name, missing, self._drafts, keep).run(ways, stop)
            stream.flush()
            os.fsync(descriptor)
        return whole


def load_copies(folder: Path) -> dict[str, dict]:
    """What was proven equal; nothing where the book is damaged: it is proven again."""
    try:
        known = json.loads((folder / BOOK).read_bytes())
    except (OSError, ValueError):
        return {}
    return known if isinstance(known, dict) else {}


def _missing(stream, wanted: Listed) -> Iterator[Segment]:
    """Segments that are not here as they are at home."""
    for number, sha256 in enumerate(wanted.segments):
        first = number * SEGMENT
        stream.seek(first)
        if hashlib.sha256(stream.read(SEGMENT)).hexdigest() != sha256:
            yield Segment(first, sha256, min(SEGMENT, wanted.size - first))


def _full(listed: Listed) -> Listed:
    """What of a growing file stays as it is."""
    count = listed.size // SEGMENT
    update = {"size": count * SEGMENT, "segments": listed.segments[:count]}
    return listed.model_copy(update=update)


def _part(path: Path) -> Path:
    return path.with_name(path.name + PART)


def _index(answer: bytes) -> dict[str, str]:
    """Sessions and their stamps, of names that can be."""
    if len(answer) > LARGEST:
        raise SiteError("home's list of sessions is too long")
    found = {}
    for line in answer.decode(errors="replace").splitlines():
        session, _, stamp = line.partition(" ")
        if SESSION.fullmatch(session):
            found[session] = stamp[:64]
    return found


def _listing(answer: bytes) -> Listing:
    try:
        if len(answer) > LARGEST:
            raise ValueError
        listing = Listing.model_validate_json(answer)
    except (ValidationError, ValueError):
        raise SiteError(UNREADABLE) from None
    for name, listed in listing.files.items():
        if not FILE.fullmatch(name) or len(listed.segments) != -(-listed.size // SEGMENT):
            raise SiteError(f"home's list of segments has {name[:60]!r}, which cannot be")
    return listing
