"""Rate tables: what a procedure asks of one, and one that takes text commands over a line."""

import math
import re
import threading
from typing import Protocol

import serial

from sessions.procedure.driven.description import Description, TableError
from sessions.procedure.driven.guard import HANGS_S, Guard
from sessions.procedure.driven.line import LONGEST, Patience, drain, opened, send

PER_UNIT = {"deg/s": math.pi / 180.0, "rad/s": 1.0, "rpm": 2.0 * math.pi / 60.0}  # rad/s


class RateTable(Protocol):
    """A table that turns about one axis, positive counter-clockwise seen from above. Every method
    raises TableError.
    """

    @property
    def name(self) -> str:
        """For people."""
        ...

    @property
    def if_lost(self) -> str:
        """What stops it when nobody drives it any more, in words."""
        ...

    @property
    def limit(self) -> float:
        """Largest rate, rad/s."""
        ...

    def take(self) -> None:
        """Begin to be the one who commands it."""
        ...

    def set_rate(self, omega: float, acceleration: float | None = None) -> None:
        """Turn at omega, rad/s, reached with that acceleration, rad/s^2, where it can be set."""
        ...

    def rate(self) -> float:
        """What it says that it turns at, rad/s."""
        ...

    def stop(self) -> None:
        """Stand, as fast as it can."""
        ...

    def release(self) -> None:
        """Leave it to others, and close the line."""
        ...

    def abandon(self) -> None:
        """Another process commands it: close the line without a word."""
        ...

    def give_up(self) -> None:
        """Leave one that does not stand, or does not answer, to its guard; raises nothing."""
        ...


class TextTable:
    """A table over a serial line, or tcp://host:port, that is opened when it is needed."""

    def __init__(self, description: Description, port: str) -> None:
        self._said, self._port = description, port
        self._per_unit = PER_UNIT[description.unit] * (
            -1.0 if description.clockwise_is_positive else 1.0
        )
        self._line: serial.SerialBase | None = None
        self._lock = threading.RLock()
        self._guard = Guard(description.model_dump_json(), port)
        self._let_go = threading.Event()  # set: nobody is kept alive
        self._hurry = threading.Event()  # set: a stop waits, nobody listens to an answer any more

    @property
    def name(self) -> str:
        """Of the description."""
        return self._said.title

    @property
    def if_lost(self) -> str:
        """What stops it when nobody drives it any more, in words."""
        commands, watchdog_s = self._said.commands, self._said.watchdog_s
        own = (
            f"when this machine or the line to it fails, the table stops by its own watchdog after"
            f" {watchdog_s:g} s"
            if commands.watchdog
            else "the table has no watchdog of its own: when this machine or the line to it fails,"
            " it TURNS ON until somebody switches it off"
        )
        return f"when the procedures are killed or hang for {HANGS_S:g} s, a guard stops it; {own}"

    @property
    def limit(self) -> float:
        """Largest rate, rad/s."""
        return math.radians(self._said.limits.rate_dps)

    def take(self) -> None:
        """Open the line, ask who is there, take over; from here on it is stopped when this process
        is killed or hangs.
        """
        commands, replies = self._said.commands, self._said.replies
        if commands.identify:
            told = self._ask(commands.identify)
            if not re.search(replies.identify, told):
                raise TableError(
                    f"{self.name} on {self._port}: says {told[:80]!r}, wanted {replies.identify!r}:"
                    " is it the table of this description?"
                )
        self._tell(commands.remote)
        self._tell(commands.watchdog, seconds=self._said.watchdog_s)
        self._guard.begin()
        if commands.watchdog:
            self._let_go.set()  # of a taking before
            self._let_go = threading.Event()
            threading.Thread(target=self._keep, args=(self._let_go,), daemon=True).start()

    def _keep(self, let_go: threading.Event) -> None:
        """Keep the table's own watchdog quiet: it guards the line and this machine, the guard this
        process.
        """
        while not let_go.wait(self._said.watchdog_s / 3.0):
            try:
                if self._said.commands.keep_alive:
                    self._tell(self._said.commands.keep_alive)
                else:
                    self._ask(self._said.commands.read_rate)
            except TableError:
                continue  # who drives it asks on his own, and says it

    def set_rate(self, omega: float, acceleration: float | None = None) -> None:
        """See RateTable."""
        if not abs(omega) <= self.limit:
            most = self._said.limits.rate_dps
            raise TableError(
                f"{self.name}: {math.degrees(omega):g} °/s, it can {most:g}: change the procedure"
            )
        if acceleration is not None and self._said.commands.set_acceleration:
            most = math.radians(self._said.limits.acceleration_dps2)
            value = min(abs(acceleration), most) / PER_UNIT[self._said.unit]
            self._tell(self._said.commands.set_acceleration, acceleration=value)
        self._tell(self._said.commands.set_rate, rate=omega / self._per_unit)

    def rate(self) -> float:
        """See RateTable."""
        told = self._ask(self._said.commands.read_rate)
        self._guard.alive()
        found = re.search(self._said.replies.rate, told)
        try:
            value = float(found.group(1)) if found else math.nan
        except (ValueError, IndexError):
            value = math.nan
        if not math.isfinite(value):
            raise TableError(
                f"{self.name}: {self._said.commands.read_rate!r} was answered by {told[:80]!r}; "
                f"wanted {self._said.replies.rate!r}"
            )
        return value * self._per_unit

    def stop(self) -> None:
        """See RateTable; what waits for an answer gives way."""
        self._hurry.set()
        with self._lock:
            self._hurry.clear()
            self._tell(self._said.commands.stop)
        self._guard.end()  # who stopped it sets no rate any more

    def release(self) -> None:
        """See RateTable."""
        self._let_go.set()
        try:
            self._tell(self._said.commands.local)
        finally:
            self._guard.end()
            self.close()

    def abandon(self) -> None:
        """See RateTable."""
        self._let_go.set()
        self._guard.end()
        self.close()

    def give_up(self) -> None:
        """See RateTable."""
        self._let_go.set()
        self.close()  # the guard opens it
        self._guard.leave()

    def close(self) -> None:
        """Close the line; it is opened again when it is needed."""
        with self._lock:
            self._close()

    def _tell(self, command: str, **numbers: float) -> None:
        if not command:
            return
        for name, value in numbers.items():
            command = command.replace(f"{{{name}}}", f"{value:.{self._said.digits}f}")
        if not self._said.answer:
            self._exchange(command, False)
            return
        told = self._exchange(command, True)
        if not re.search(self._said.answer, told):
            raise TableError(f"{self.name}: {command!r} was answered by {told[:80]!r}")

    def _ask(self, command: str) -> str:
        return self._exchange(command, True)

    def _exchange(self, command: str, answered: bool) -> str:
        with self._lock:
            try:
                return self._talk(command, answered)
            except (OSError, serial.SerialException) as error:
                self._close()
                why = getattr(error, "strerror", None) or str(error)
                raise TableError(f"{self.name} on {self._port}: {why}") from None

    def _talk(self, command: str, answered: bool) -> str:
        line, end, limit_s = self._open(), self._said.terminator.encode(), self._said.timeout_s
        drain(line)
        send(line, command.encode() + end, limit_s)
        if not answered:
            return ""
        patience, told = Patience(limit_s), b""
        while not told.endswith(end):
            if self._hurry.is_set():
                raise TableError(f"{self.name}: {command!r} was given up for a stop")
            if patience.over() or len(told) >= LONGEST:
                heard = repr(told[:80].decode(errors="replace")) if told else "nothing"
                raise TableError(
                    f"{self.name} on {self._port}: {command!r} was answered by {heard} within "
                    f"{limit_s:g} s"
                )
            told += line.read(1)
        return told.decode(errors="replace").strip()

    def _open(self) -> serial.SerialBase:
        if self._line is None:
            self._line = opened(self._port, self._said.baud)
        return self._line

    def _close(self) -> None:
        if self._line is not None:
            self._line.close()
            self._line = None
