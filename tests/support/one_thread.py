"""Stops one thread of another process, as a debugger does; the others go on.

A thread that is stopped while it holds the interpreter's lock would stop all others too: it is let
go and tried again until it waits in the kernel.
"""

import contextlib
import ctypes
import os
import time
from collections.abc import Iterator
from pathlib import Path

SEIZE, DETACH, INTERRUPT = 0x4206, 17, 0x4207  # sys/ptrace.h
WALL = 0x40000000  # of waitpid: threads, too
TRIES = 200
# calls that wait: futex, select, poll, ppoll, pselect6, epoll_wait, epoll_pwait, clock_nanosleep
WAITS = frozenset("202 23 7 271 270 232 281 230".split())  # of x86-64, ...
WAITS |= frozenset("98 73 72 22 115".split())  # ... of aarch64

_libc = ctypes.CDLL(None, use_errno=True)
_libc.ptrace.argtypes = [ctypes.c_long, ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]


def _ptrace(request: int, thread: int) -> None:
    if _libc.ptrace(request, thread, None, None) < 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number), f"thread {thread}")


def thread_of(pid: int, name: str) -> int:
    """The thread of that name (15 characters count); the first thread for an empty one."""
    if not name:
        return pid
    for task in Path(f"/proc/{pid}/task").iterdir():
        if (task / "comm").read_text().strip() == name[:15]:
            return int(task.name)
    raise LookupError(f"process {pid} has no thread {name!r}")


@contextlib.contextmanager
def held(pid: int, name: str = "") -> Iterator[None]:
    """Stop a thread of a child of ours, or of a process that we may debug. Raises OSError."""
    thread = thread_of(pid, name)
    for _ in range(TRIES):
        _ptrace(SEIZE, thread)
        _ptrace(INTERRUPT, thread)
        os.waitpid(thread, WALL)
        if _waits(pid, thread):
            break
        _ptrace(DETACH, thread)
        time.sleep(0.01)
    else:
        raise OSError(f"thread {name!r} of {pid} never waits")
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            _ptrace(DETACH, thread)


def _waits(pid: int, thread: int) -> bool:
    """Was it stopped inside a call to the kernel that waits? Then it does not hold the lock."""
    said = Path(f"/proc/{pid}/task/{thread}/syscall").read_text().split()
    return said[0] in WAITS
