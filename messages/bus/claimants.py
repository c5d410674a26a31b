"""Who serves and who waits for a gateway's boards, by the tokens of their claims."""

from messages.bus.claiming import WAITING, rank_of

MOST = 512  # boards, and tokens of one


class Claimants:
    """Who serves and who waits for a gateway's boards; filled by Zenoh's thread."""

    def __init__(self) -> None:
        self._there: dict[str, dict[str, str]] = {}  # device -> name of a token -> id of a session

    def heard(self, key: str, there: bool) -> None:
        """A token of a claim came or went."""
        parts = key.split("/")
        device, name = parts[1], parts[-1]
        rank = rank_of(name.removeprefix(f"{WAITING}-"))
        if rank is None or (device not in self._there and len(self._there) >= MOST):
            return
        known = self._there.setdefault(device, {})
        if not there:
            known.pop(name, None)
        elif len(known) < MOST:
            known[name] = rank[1]
        if not known:
            del self._there[device]

    def serving(self, device: str) -> set[str]:
        """Ids of the sessions that have claimed it."""
        known = dict(self._there.get(device, {}))
        return {id_ for name, id_ in known.items() if not name.startswith(WAITING)}

    def waiting(self, device: str) -> set[str]:
        """Ids of those that wait to."""
        known = dict(self._there.get(device, {}))
        return {id_ for name, id_ in known.items() if name.startswith(WAITING)}

    def contested(self) -> dict[str, list[str]]:
        """Boards that more than one gateway wants, and by which sessions."""
        return {
            device: sorted(ids)
            for device in list(self._there)
            if len(ids := self.serving(device) | self.waiting(device)) > 1
        }
