"""What goes along with every session of a process, such as an ear for orders to the process
itself.
"""

from collections.abc import Callable
from typing import Any

import zenoh

How = Callable[[zenoh.Session, Any], object]  # of a session and its BusSettings
_attending: list[How] = []
_kept: list[object] = []


def attend(how: How) -> None:
    """Have this called with every session that this process opens from now on; what it returns is
    kept as long as the process.
    """
    _attending.append(how)


def opened(session: zenoh.Session, settings: Any) -> zenoh.Session:
    """The session, attended."""
    _kept.extend(how(session, settings) for how in _attending)
    return session
