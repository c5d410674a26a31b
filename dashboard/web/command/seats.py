"""Whose order it is: a browser's sign-in or a program's token, by a name that tells nothing of
them.
"""

import hashlib
import threading

from dashboard.web.auth import Gate
from dashboard.web.users import UsersError

MOST = 4096  # remembered; far more than there are sign-ins


class Seats:
    """Which sign-in is behind a seat; kept beside the gate."""

    def __init__(self, gate: Gate) -> None:
        self._gate, self._lock = gate, threading.Lock()
        self._keys: dict[str, str] = {}  # seat -> key of the sign-in

    def of_key(self, key: str) -> str:
        """Name of the seat of a sign-in."""
        name = seat_name(key)
        with self._lock:
            if name not in self._keys and len(self._keys) >= MOST:
                self._keys.pop(next(iter(self._keys)))
            self._keys[name] = key
        return name

    def alive(self, seat: str) -> bool:
        """The sign-in still stands; of a token its use tells. While the users file cannot be read
        nobody is judged: who has the command keeps it, and orders nothing either.
        """
        key = self._keys.get(seat)
        try:
            return key is None or self._gate.look_up(key) is not None
        except UsersError:
            return True


def seat_name(key: str) -> str:
    """Of a sign-in's key, which is a hash itself."""
    return f"s-{hashlib.sha256(f'seat {key}'.encode()).hexdigest()[:20]}"
