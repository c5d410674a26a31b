"""How connections to other machines take losses and cuts.

TCP sends what was lost again after twice the time each time: three packets lost in a row hold up
all that is live for seconds, and after a cut of 30 s it would be silent for another 30. So the
times do not grow, and a connection on which nothing is acknowledged for a while is given up. And
the kernel takes megabytes at once, in which the newest would stand behind the oldest: it gets only
what it is about to send. Zenoh has no settings for that, so they are made on the sockets of the
process; on those of a child (Zenoh's own router) through copies of its descriptors, which Linux
gives a parent.
"""

import contextlib
import ctypes
import ipaddress
import os
import socket
import threading
from pathlib import Path

GIVEN_UP_MS = 4_000
AGAIN_MS = 1_000  # at most, before what was lost is sent again; the least that Linux takes
UNSENT = 8_192  # bytes that wait in the kernel
LOOK_S = 0.5
PIDFD_GETFD = 438  # linux/unistd.h, the same on every machine
RTO_MAX_MS, NOTSENT_LOWAT = 44, 25  # linux/tcp.h, not in every Python
OPTIONS = (
    (socket.TCP_USER_TIMEOUT, GIVEN_UP_MS),
    (NOTSENT_LOWAT, UNSENT),
    (16, 1),  # TCP_THIN_LINEAR_TIMEOUTS: while few packets are under way, also on older kernels
    (RTO_MAX_MS, AGAIN_MS),  # Linux 6.15
)


def watch(stop: threading.Event, child: int = 0) -> threading.Thread:
    """Look after the sockets of this process, or of a child by its number, until `stop`."""
    thread = threading.Thread(target=_run, args=(stop, child), name="timeouts", daemon=True)
    thread.start()
    return thread


def _run(stop: threading.Event, child: int) -> None:
    while not stop.wait(LOOK_S):
        look(child)


def look(child: int = 0) -> None:
    """Once: every TCP socket, those that are still connecting too."""
    with contextlib.ExitStack() as stack, contextlib.suppress(OSError):
        pidfd = -1
        if child:
            pidfd = os.pidfd_open(child)  # raises where it has ended
            stack.callback(os.close, pidfd)
        for entry in Path(f"/proc/{child or 'self'}/fd").iterdir():
            with contextlib.suppress(OSError, ValueError):
                if not os.readlink(entry).startswith("socket:"):
                    continue
                with socket.socket(fileno=_copy(pidfd, int(entry.name))) as one:
                    if one.family in (socket.AF_INET, socket.AF_INET6) and not _here(one):
                        _set(one)


def _copy(pidfd: int, descriptor: int) -> int:
    """A descriptor of ours for the same socket; raises OSError."""
    if pidfd < 0:
        return os.dup(descriptor)
    libc = ctypes.CDLL(None, use_errno=True)
    copy = libc.syscall(PIDFD_GETFD, pidfd, descriptor, 0)
    if copy < 0:
        raise OSError(ctypes.get_errno(), "pidfd_getfd")
    return copy


def _set(one: socket.socket) -> None:
    for option, value in OPTIONS:
        with contextlib.suppress(OSError):  # a kernel that does not know it
            if one.getsockopt(socket.IPPROTO_TCP, option) != value:
                one.setsockopt(socket.IPPROTO_TCP, option, value)


def _here(one: socket.socket) -> bool:
    """Within this machine, where a process may be stopped for longer and nothing is lost."""
    address = one.getsockname()[0].removeprefix("::ffff:")
    return ipaddress.ip_address(address.partition("%")[0]).is_loopback
