"""Look after the services of a supervisor until they are told to end, and say when the page is
there.
"""

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


@dataclass(frozen=True)
class Watch:
    """One run of a supervisor's children."""

    supervisor: Supervisor
    settings: Settings
    welcome: list[tuple[str, str]]  # said once the page answers: text and style; none: no page
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
        supervisor, said = self.supervisor, not self.welcome
        deadline = time.monotonic() + WAIT_FOR_PAGE
        while not stop.wait(TICK) and supervisor.fatal is None and not supervisor.done:
            supervisor.step()
            self.each()
            if said:
                continue
            if health("dashboard", self.settings).state == "ok":
                said = True
                for text, style in self.welcome:
                    supervisor.say(text, style)
            elif time.monotonic() > deadline:
                raise fail(
                    f"the dashboard does not answer after {WAIT_FOR_PAGE:g} s; the log above"
                    " says why"
                )
