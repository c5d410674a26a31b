"""A service that must be back at once: a warm process that does nothing but start it again and hold
its ports.

A gateway that is killed comes back after the seconds that Python takes to load, and as long its
board's samples are lost. So `guard` forks: the parent has everything loaded, opens nothing, and
waits; the child is the service. When the child is killed the next one is there within milliseconds.
The child gives the parent every port that it opens (SCM_RIGHTS): killed, it leaves them open, the
kernel keeps the bytes, and the next child finds them inherited. When the parent is killed, the
child goes on for HANDOVER_S, until whoever looks after the parent has the next one warm.
"""

import logging
import os
import select
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable

import typer

from gateway.ports.keeper import Catcher, Keeper, Left

HANDOVER_S = 6.0
LOOK_S = 0.2
GOOD_LIFE_S = 1.0  # a child that is killed sooner is not started again at once
KILLED = {signal.SIGKILL, signal.SIGSEGV, signal.SIGABRT, signal.SIGBUS}
ANEW = (
    signal.SIGUSR2
)  # to the guardian: begin the service anew, as after a change of its certificate
WORD_BYTES = 4096  # of one message to the guardian: a sign and the port's name
KEEP, DROP = b"+", b"-"

log = logging.getLogger(__name__)


class Ward(Keeper):
    """The child's side: gives its open ports away, and reads from its first moment those that an
    earlier child left.
    """

    def __init__(self, line: socket.socket, kept: dict[str, int]) -> None:
        self._line = line
        self._kept = {url: Catcher(fd) for url, fd in kept.items()}

    def keep(self, url: str, fd: int) -> None:
        """Hold an open port for whoever comes after us."""
        self._say(KEEP + url.encode(), fd)

    def drop(self, url: str) -> None:
        """Let a port go that was lost or closed, so that it can be opened anew."""
        self._say(DROP + url.encode())

    def take(self, url: str) -> Left | None:
        """A port that an earlier life left open, once; None when there is none."""
        catcher = self._kept.pop(url, None)
        return None if catcher is None else catcher.stop()

    def holds(self, url: str) -> bool:
        """True while `take` has something to give."""
        return url in self._kept

    def _say(self, word: bytes, *descriptors: int) -> None:
        try:
            socket.send_fds(self._line, [word], descriptors)
        except OSError:
            pass  # the guardian is gone; a port that nobody holds is lost with us, as it always was


def guard(serve: Callable[[Keeper], None]) -> None:
    """Run `serve` in a child, again whenever it was killed; raises typer.Exit with its exit code
    when it ended itself.

    To be called with everything imported and before any thread.
    """
    guardian = os.getpid()
    child = [0]
    kept: dict[str, int] = {}

    def forward(number: int, _: object) -> None:
        # killed it goes on with its ports open, where an orderly end would close them
        meant = {signal.SIGUSR1: signal.SIGUSR1, ANEW: signal.SIGKILL}
        if child[0]:
            os.kill(child[0], meant.get(number, signal.SIGTERM))

    # A signal that comes just before poll() sleeps does not wake it, and its handler would wait for
    # the child's end.
    awake, wake = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
    while True:
        born = time.monotonic()
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGUSR1, ANEW):
            signal.signal(number, forward)
        signal.set_wakeup_fd(wake, warn_on_full_buffer=False)
        mine, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        child[0] = os.fork()
        if not child[0]:
            signal.set_wakeup_fd(-1)
            for fd in (awake, wake):
                os.close(fd)
            mine.close()
            _be_child(serve, guardian, Ward(its, kept))
        its.close()
        status = _wait(child[0], mine, kept, awake)
        child[0] = 0
        mine.close()
        if os.WIFEXITED(status):
            raise typer.Exit(os.WEXITSTATUS(status))
        if os.WTERMSIG(status) not in KILLED:
            raise typer.Exit(128 + os.WTERMSIG(status))
        print(
            f"WARNING killed by {signal.Signals(os.WTERMSIG(status)).name}: starting again",
            file=sys.stderr,
        )
        if time.monotonic() - born < GOOD_LIFE_S:
            time.sleep(GOOD_LIFE_S)


def _wait(child: int, line: socket.socket, kept: dict[str, int], awake: int) -> int:
    """Hold what the child gives until it ends; its wait status. Nothing it said before its end is
    overlooked.

    awake: readable when a signal came, whose handler runs as soon as poll() is left.
    """
    life = os.pidfd_open(child)
    poller = select.poll()
    poller.register(life, select.POLLIN)
    poller.register(line, select.POLLIN)
    poller.register(awake, select.POLLIN)
    try:
        while True:
            ready = {fd for fd, _ in poller.poll()}
            if awake in ready:
                os.read(awake, WORD_BYTES)
                continue
            if line.fileno() in ready and not _listen(line, kept):
                poller.unregister(line)
            if ready == {life}:
                return os.waitpid(child, 0)[1]
    finally:
        os.close(life)


def _listen(line: socket.socket, kept: dict[str, int]) -> bool:
    """One word of the child; False when it can say no more."""
    try:
        word, descriptors, _, _ = socket.recv_fds(line, WORD_BYTES, 1)
    except OSError:
        return False
    if not word:
        return False
    url = word[1:].decode()
    old = kept.pop(url, None)
    if old is not None:
        os.close(old)
    if word[:1] == KEEP and descriptors:
        kept[url] = descriptors[0]
    return True


def leave_when_alone(stop: threading.Event) -> None:
    """In the child: set `stop` some seconds after the guardian has gone."""
    guardian = _guardian
    if not guardian:
        return

    def look() -> None:
        while not stop.wait(LOOK_S):
            if os.getppid() != guardian:
                log.warning(
                    "the process that guards this one is gone: handing over in %g s", HANDOVER_S
                )
                stop.wait(HANDOVER_S)
                stop.set()

    threading.Thread(target=look, name="guardian", daemon=True).start()


_guardian = 0  # process id, in the child


def _be_child(serve: Callable[[Keeper], None], guardian: int, keeper: Keeper) -> None:
    global _guardian
    _guardian = guardian
    code = 0
    try:
        serve(keeper)
    except typer.Exit as end:
        code = end.exit_code
    except BaseException:
        log.exception("failed")
        code = 1
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
