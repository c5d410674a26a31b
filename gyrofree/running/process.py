"""How a service process lives: its log, its signals, its exit code.

Logs go to stderr, data to stdout. Exit codes: 0 ended as asked, 1 could not go on (the log says
why), 2 wrong command line or configuration, 3 a port or device name is taken.
"""

import atexit
import contextlib
import errno
import gc
import logging
import os
import signal
import sys
import threading
from collections.abc import Callable

import typer
import zenoh

from gyrofree.config import ConfigError
from gyrofree.operations import log_form
from gyrofree.operations.attending import Attended
from gyrofree.operations.settings import LogSettings
from messages.bus.faults import BusUnavailable, IdentityError
from messages.text import printed, reason

EXIT_FAILED = 1
EXIT_CONFIG = 2
EXIT_TAKEN = 3

SETTLED = 8.0  # s after the start: imports and compiled functions are loaded

log = logging.getLogger(__name__)


def command(*arguments: str) -> list[str]:
    """How a process of the product starts another one: `gyrofree ARGUMENTS`.

    With -P nothing that lies in the working folder is imported: a person's own `estimator.py` or
    `numpy.py` there is theirs alone.
    """
    return [sys.executable, "-P", "-m", "gyrofree", *arguments]


def start_logging(settings: LogSettings | None = None, verbose: bool = False) -> None:
    """Log on stderr, one line an event."""
    log_form.start("gyrofree", settings, verbose)


def stop_on_signals(toggle: Callable[[], None] | None = None) -> threading.Event:
    """An event that SIGTERM and Ctrl-C set. To be called in the main thread. toggle: what SIGUSR1
    does.

    Not set by a handler in Python: that runs in the main thread once it wakes, and not at all while
    it sleeps and the signal met another one; and awake, it may be inside stop.wait() and hold the
    event's lock, for which set() would then wait for good. What the interpreter writes into a pipe
    at once, in whichever thread, is read by one of ours.
    """
    global _service
    stop = threading.Event()
    told, tell = os.pipe2(os.O_CLOEXEC)
    os.set_blocking(tell, False)

    def listen() -> None:
        while os.read(told, 1)[0] == signal.SIGUSR1:
            toggle()  # type: ignore[misc]
        stop.set()

    threading.Thread(target=listen, name="signals", daemon=True).start()
    for number in (signal.SIGTERM, signal.SIGINT, *([signal.SIGUSR1] if toggle else [])):
        signal.signal(number, lambda *_: None)
    signal.set_wakeup_fd(tell, warn_on_full_buffer=False)
    atexit.register(_end_in_peace)
    _service = True
    return stop


def _end_in_peace() -> None:
    """A second signal must not kill a process that is ending: the interpreter would give signals
    their default back before it is gone.
    """
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, signal.SIG_IGN)


_service, _code = False, 0  # this process is one, and what the command line ends with


@atexit.register  # when this is read, so that it comes after all that is registered later
def _leave() -> None:
    """A service does not take its interpreter down: a thread of the bus that lets go of what it
    held asks for it, late, and would end the process by SIGABRT ("exception not rethrown"). All of
    ours has ended by now.
    """
    if not _service:
        return
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(
            OSError, ValueError, AttributeError
        ):  # a broken pipe, closed, none
            stream.flush()
    os._exit(EXIT_FAILED if hasattr(sys, "last_value") else _code)


def ending(code: int | str | None) -> None:
    """The command line ends so, as SystemExit says it."""
    global _code
    _code = code if isinstance(code, int) else EXIT_FAILED if code else 0


def fail(why: str | Exception, code: int = EXIT_FAILED) -> typer.Exit:
    """Say why on stderr; raise what this returns."""
    for line in printed(reason(why)).splitlines():
        print(f"gyrofree: {line}", file=sys.stderr)
    return typer.Exit(code)


def run_service(
    body: Callable[[threading.Event], None],
    verbose: bool = False,
    attended: Attended | None = None,
) -> None:
    """Run a service until it ends or is told to; faults become one line and an exit code.

    attended: where it is one that others look after, with a name of its own.
    """
    if attended is None:
        start_logging(verbose=verbose)
        stop = stop_on_signals()
    else:
        stop = stop_on_signals(attended.start(verbose).toggle)
    settled = threading.Timer(SETTLED, _spare_the_collector)
    settled.daemon = True
    settled.start()
    try:
        body(stop)
    except (ConfigError, IdentityError) as error:
        raise fail(error, EXIT_CONFIG) from None
    except BusUnavailable as error:
        if not stop.is_set():
            raise fail(error) from None
    except zenoh.ZError as error:
        raise fail(
            _first_line(error), EXIT_TAKEN if "in use" in str(error) else EXIT_FAILED
        ) from None
    except OSError as error:
        raise fail(error, EXIT_TAKEN if error.errno == errno.EADDRINUSE else EXIT_FAILED) from None
    finally:
        settled.cancel()
        gc.unfreeze()  # or the core reports every filter that still lives as a leak


def _spare_the_collector() -> None:
    """Keep what is loaded for good out of garbage collection, whose full passes stop a service for
    tens of ms.
    """
    gc.collect()
    gc.freeze()


def _first_line(error: Exception) -> str:
    return str(error).split(" at /")[0].splitlines()[0]
