"""Look after the services of a supervisor until they are told to end, and say when the page is
there.
"""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from gyrofree.config import Settings
from gyrofree.running.doctor import health
from gyrofree.running.process import EXIT_FAILED, fail
from gyrofree.running.supervisor import Supervisor

SERVICES = (
    "router",
    "gateway",
    "estimator",
    "record",
    "procedures",
    "alarms",
    "dashboard",
)  # in the order of their start
TICK = 0.1  # s between two looks at the children
DRAIN = 3.0  # s that the last samples of a played log have to reach the recording
WAIT_FOR_PAGE = 60.0  # s; a cold compile cache needs most of it
QUIET = 2.0  # s without a line, after which the welcome is said again below what covered it
BEGINNING = 60.0  # s from the first welcome in which one line covers it
SCREENFUL = 20  # lines that cover it later, on a terminal


@dataclass(frozen=True)
class Watch:
    """One run of a supervisor's children."""

    supervisor: Supervisor
    settings: Settings
    welcome: Callable[[], list[tuple[str, str]]]  # said once the page answers, and again where it
    # was scrolled away: text and style; none: no page
    each: Callable[[], None] = lambda: None  # called between two looks

    def run(self, stop: threading.Event) -> None:
        """Until `stop`, or until a child ends all; raises typer.Exit when one could not go on.

        A child whose configuration is wrong or whose port is taken gives its exit code on.
        """
        supervisor = self.supervisor
        supervisor.start()
        try:
            self._look(stop)
            if supervisor.done:
                supervisor.say("the log has been played to its end")
                stop.wait(DRAIN)
        finally:
            supervisor.say("stopping")
            clean = supervisor.stop()
            supervisor.say("stopped cleanly" if clean else "stopped; a process had to be killed")
        if supervisor.fatal is not None:
            code = supervisor.fatal_code
            raise fail(f"{supervisor.fatal.name} could not go on", max(code, EXIT_FAILED))

    def _look(self, stop: threading.Event) -> None:
        supervisor, said = self.supervisor, not self.welcome()
        greeter = _Greeter(supervisor, self.welcome)
        deadline = time.monotonic() + WAIT_FOR_PAGE
        while not stop.wait(TICK) and supervisor.fatal is None and not supervisor.done:
            supervisor.step()
            self.each()
            if said:
                greeter.look()
            elif health("dashboard", self.settings).state == "ok":
                said = True
                greeter.say()
            elif time.monotonic() > deadline:
                deadline = math.inf  # a machine that starts slowly ends no recording by it
                text = f"the dashboard does not answer after {WAIT_FOR_PAGE:g} s"
                supervisor.say(f"{text}: does the log say why? all else goes on", "yellow")


class _Greeter:
    """Says the welcome, and again where the log has scrolled it away and has come to rest."""

    def __init__(
        self, supervisor: Supervisor, welcome: Callable[[], list[tuple[str, str]]]
    ) -> None:
        self._supervisor, self._welcome = supervisor, welcome
        self._first: float | None = None  # s, monotonic: when it was said first
        self._seen = 0  # lines of the log when it was said last

    def say(self) -> None:
        """Now."""
        lines = self._welcome()
        self._seen = self._supervisor.lines + len(lines)  # what comes between them covers them
        for text, style in lines:
            self._supervisor.say(text, style)
        self._first = self._first or time.monotonic()

    def look(self) -> None:
        """Say it where it is covered; cheap."""
        supervisor, now = self._supervisor, time.monotonic()
        covered = supervisor.lines - self._seen
        if self._first is None or not covered or now - supervisor.last_line < QUIET:
            return
        beginning = now - self._first < BEGINNING
        if beginning or (covered >= SCREENFUL and supervisor.console.is_terminal):
            self.say()
