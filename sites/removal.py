"""A place goes: at once, and without being asked."""

from pathlib import Path

from inertial.one_at_a_time import alone
from sites.authority import Authority
from sites.invitation import load_book, save_book
from sites.place import SiteError, load_place, save_place


def remove(folder: Path, place: str) -> int:
    """Revoke all certificates of a place and forget it; how many. Raises SiteError."""
    with alone(folder):
        return _remove(folder, place)


def _remove(folder: Path, place: str) -> int:
    here, authority = load_place(folder), Authority(folder)
    if place == here.place:
        raise SiteError(f"{place} is this place: the home of a site cannot be removed")
    names = {e.common_name for e in authority.register() if e.place == place and e.revoked is None}
    if not names and all(peer.place != place for peer in here.peers):
        known = ", ".join(peer.place for peer in here.peers) or "none"
        raise SiteError(f"no place {place!r} belongs to the site; there are {known}")
    count = sum(authority.revoke(name) for name in sorted(names))
    save_book(folder, [entry for entry in load_book(folder) if entry.place != place])
    peers = tuple(peer for peer in here.peers if peer.place != place)
    save_place(folder, here.model_copy(update={"peers": peers}))
    return count
