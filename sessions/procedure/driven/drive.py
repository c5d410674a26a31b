"""The table of a run: taken, driven, told to stand until it takes it, and let go. A hand crank has
none, and nothing of it happens.
"""

import logging
import math
import threading

from sessions.procedure.driven.description import TableError
from sessions.procedure.driven.table import RateTable
from sessions.procedure.model import DEG

log = logging.getLogger(__name__)

ASK_S = 1.0  # s between two questions to the table, and two orders to stand
STANDS = 1.0 * DEG  # rad/s
RAMP_S, CLOSING_S = 10.0, 30.0  # s until it should stand, until it is given up
SLOWEST = 5.0 * DEG  # rad/s^2, of a ramp


class Drive:
    """Of one run. `stop` is for any thread, everything else for one.

    `rate`, rad/s: what it was told, then what it says. `alarm` is not empty where it was told to
    stand and may still turn; it is told again until it takes it.
    """

    def __init__(self, table: RateTable | None) -> None:
        self.table, self.rate, self.alarm = table, 0.0, ""
        self._taken, self._asked = False, -math.inf
        self._stopped = threading.Event()
        self._driving = threading.Lock()

    @property
    def name(self) -> str:
        """Of the table; empty: a person turns it."""
        return self.table.name if self.table is not None else ""

    @property
    def turns(self) -> bool:
        """As far as is known."""
        return self.table is not None and abs(self.rate) > STANDS

    def take(self) -> str:
        """Become the one who commands it; what is wrong with it, or empty."""
        if self.table is None or self._taken:
            return ""
        try:
            self.table.take()
        except TableError as error:
            return str(error)
        self._taken = True
        return ""

    def turn(self, omega: float, ramp_s: float) -> None:
        """Go to omega, rad/s, unless it was stopped meanwhile. Raises TableError."""
        with self._driving:
            if self.table is None or self._stopped.is_set():
                return
            change = abs(omega - self.rate)
            try:
                self.table.set_rate(omega, max(change / ramp_s, SLOWEST) if ramp_s else None)
            except TableError:
                self._taken = False  # it may have been off: next time it is taken over anew
                raise
            self.rate = omega

    def stand(self, ramp_s: float = 0.0) -> None:
        """Come to rest."""
        try:
            self.turn(0.0, ramp_s)
        except TableError as error:
            self._refused(error)

    def stop(self) -> str:
        """Stop at once and for good, from any thread; what went wrong, or empty."""
        self._stopped.set()
        if self.table is None:
            return ""
        self._halt()
        with self._driving:  # what was on its way to the table has gone: once more
            return self._halt()

    def abandon(self) -> None:
        """Another process commands it now: nothing more is said to it."""
        self._stopped.set()
        with self._driving:
            if self.table is not None:
                self.table.abandon()

    def _halt(self) -> str:
        try:
            self.table.stop()
        except TableError as error:
            return self._refused(error)
        self.alarm = ""
        return ""

    def _refused(self, error: TableError) -> str:
        self._taken = False
        self.alarm = f"THE TABLE DID NOT TAKE THE STOP, switch it off: {error}"
        log.error("%s", self.alarm)
        return self.alarm

    def ask(self, now: float) -> float | None:
        """What it turns at, rad/s, once a second, else None; one that did not take its stop is
        stopped instead. Raises TableError.
        """
        if self.table is None or now - self._asked < ASK_S:
            return None
        self._asked = now
        if self.alarm:
            self._halt()
            return None
        try:
            self.rate = self.table.rate()
        except TableError:
            self._taken = False
            raise
        return self.rate

    def let_go(self, now: float, since: float) -> bool:
        """Leave it once it stands, which is wanted since then; True: it was left.

        One that does not stand, or does not answer, is stopped again and again, and at last left to
        its guard.
        """
        if self.table is None:
            return True
        late = now - since > CLOSING_S
        try:
            told = self.ask(now)
            if told is not None and not self.turns:
                self.table.release()
                return True
            if told is not None and now - since > RAMP_S:
                self._refused(TableError(f"it turns at {told / DEG:+.1f} °/s"))
        except TableError as error:
            self._refused(error)
        if late and self.alarm:
            self.table.give_up()
        return late and bool(self.alarm)
