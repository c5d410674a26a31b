"""A service that must be back at once: a warm process that does nothing but start it again.

A gateway that is killed comes back after the seconds that Python takes to load, and as long its board's samples are
lost. So `guard` forks: the parent has everything loaded, opens nothing, and waits; the child is the service. When the
child is killed the next one is there within milliseconds. When the parent is killed, the child goes on for HANDOVER_S,
until whoever looks after the parent has the next one warm.
"""

import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Callable

import typer

HANDOVER_S = 6.0
LOOK_S = 0.2
GOOD_LIFE_S = 1.0  # a child that is killed sooner is not started again at once
KILLED = {signal.SIGKILL, signal.SIGSEGV, signal.SIGABRT, signal.SIGBUS}

log = logging.getLogger(__name__)


def guard(serve: Callable[[], None]) -> None:
    """Run `serve` in a child, again whenever it was killed; raises typer.Exit with its exit code when it ended itself.

    To be called with everything imported and before any thread.
    """
    guardian = os.getpid()
    child = [0]

    def forward(number: int, _: object) -> None:
        if child[0]:
            os.kill(child[0], signal.SIGTERM)

    while True:
        born = time.monotonic()
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, forward)
        child[0] = os.fork()
        if not child[0]:
            _be_child(serve, guardian)
        _, status = os.waitpid(child[0], 0)
        child[0] = 0
        if os.WIFEXITED(status):
            raise typer.Exit(os.WEXITSTATUS(status))
        if os.WTERMSIG(status) not in KILLED:
            raise typer.Exit(128 + os.WTERMSIG(status))
        print(f"WARNING killed by {signal.Signals(os.WTERMSIG(status)).name}: starting again", file=sys.stderr)
        if time.monotonic() - born < GOOD_LIFE_S:
            time.sleep(GOOD_LIFE_S)


def leave_when_alone(stop: threading.Event) -> None:
    """In the child: set `stop` some seconds after the guardian has gone."""
    guardian = _guardian
    if not guardian:
        return

    def look() -> None:
        while not stop.wait(LOOK_S):
            if os.getppid() != guardian:
                log.warning("the process that guards this one is gone: handing over in %g s", HANDOVER_S)
                stop.wait(HANDOVER_S)
                stop.set()

    threading.Thread(target=look, name="guardian", daemon=True).start()


_guardian = 0  # process id, in the child


def _be_child(serve: Callable[[], None], guardian: int) -> None:
    global _guardian
    _guardian = guardian
    code = 0
    try:
        serve()
    except typer.Exit as end:
        code = end.exit_code
    except BaseException:
        log.exception("failed")
        code = 1
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
