"""How many people look at this dashboard: sign-ins whose pages ask for something now and then."""

import threading
import time

LOOKS_S = 15.0  # after its last question a page is taken for closed
MOST = 4096  # sign-ins


class Lookers:
    """May be used by several threads. Nothing of a person is kept but his role."""

    def __init__(self) -> None:
        self._seen: dict[str, tuple[float, str]] = {}  # by sign-in: when, and the role
        self._lock = threading.Lock()

    def saw(self, sign_in: str, role: str) -> None:
        """A browser of this sign-in asked for something."""
        with self._lock:
            if sign_in in self._seen or len(self._seen) < MOST:
                self._seen[sign_in] = time.monotonic(), role

    def by_role(self) -> dict[str, int]:
        """How many look now."""
        with self._lock:
            now, found = time.monotonic(), dict[str, int]()
            for sign_in, (at, role) in list(self._seen.items()):
                if now - at > LOOKS_S:
                    del self._seen[sign_in]
                else:
                    found[role] = found.get(role, 0) + 1
            return found
