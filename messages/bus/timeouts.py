"""Connections of this process to other machines are given up when nothing is acknowledged for a
while. TCP tries again after twice the time each time: after a cut of 30 s it would be silent for
another 30. Zenoh has no setting for that, so it is made on the sockets of the process.
"""

import contextlib
import ipaddress
import os
import socket
import threading
from pathlib import Path

GIVEN_UP_MS = 4_000
LOOK_S = 0.5


def watch(stop: threading.Event) -> threading.Thread:
    """Look after the sockets of this process until `stop`."""
    thread = threading.Thread(target=_run, args=(stop,), name="timeouts", daemon=True)
    thread.start()
    return thread


def _run(stop: threading.Event) -> None:
    while not stop.wait(LOOK_S):
        look()


def look() -> None:
    """Once: every TCP socket, those that are still connecting too."""
    for entry in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(OSError, ValueError):
            if not os.readlink(entry).startswith("socket:"):
                continue
            with socket.socket(fileno=os.dup(int(entry.name))) as one:
                if one.family in (socket.AF_INET, socket.AF_INET6) and not _here(one):
                    one.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, GIVEN_UP_MS)


def _here(one: socket.socket) -> bool:
    """Within this machine, where a process may be stopped for longer and nothing is lost."""
    address = one.getsockname()[0].removeprefix("::ffff:")
    return ipaddress.ip_address(address.partition("%")[0]).is_loopback
