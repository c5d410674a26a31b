"""Rate tables: what a procedure asks of one, and one over a serial line whose text commands stand
in a TOML file.
"""

import math
import re
import threading
import time
import tomllib
from pathlib import Path
from typing import Literal, Protocol

import serial
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
)

from inertial.toml_file import parsed, text_of
from sessions.procedure.guard import Guard

DESCRIPTIONS = Path(__file__).parent / "tables"
LONGEST = 4096  # bytes of one reply
PER_UNIT = {"deg/s": math.pi / 180.0, "rad/s": 1.0, "rpm": 2.0 * math.pi / 60.0}  # rad/s


class TableError(RuntimeError):
    """A table that does not do what it is told; the text says which, what was sent and answered."""


class RateTable(Protocol):
    """A table that turns about one axis, positive counter-clockwise seen from above. Every method
    raises TableError.
    """

    @property
    def name(self) -> str:
        """For people."""
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


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Limits(_Part):
    """What the table can; more is not asked of it."""

    rate_dps: float = Field(gt=0)
    acceleration_dps2: float = Field(gt=0)


class Commands(_Part):
    """Texts that are sent; an empty one is not sent."""

    set_rate: str = Field(min_length=1)
    read_rate: str
    stop: str
    identify: str = ""
    remote: str = ""
    local: str = ""
    set_acceleration: str = ""
    watchdog: str = ""
    keep_alive: str = ""

    @field_validator("set_rate", "watchdog")
    @classmethod
    def _has_number(cls, text: str, info: ValidationInfo) -> str:
        number = "{seconds}" if info.field_name == "watchdog" else "{rate}"
        if text and number not in text:
            raise ValueError(f"want {number} where the number goes")
        return text


class Replies(_Part):
    """Regular expressions; of `rate` the first group is the number."""

    rate: str
    identify: str = ""

    @field_validator("rate", "identify")
    @classmethod
    def _is_one(cls, text: str) -> str:
        try:
            re.compile(text)
        except re.error as error:
            raise ValueError(f"no regular expression: {error}") from None
        return text


class Description(_Part):
    """The whole file."""

    title: str = Field(min_length=1, max_length=100)
    unit: Literal["deg/s", "rad/s", "rpm"] = "deg/s"
    digits: int = Field(default=4, ge=0, le=9)
    terminator: str = Field(default="\n", min_length=1, max_length=4)
    answer: str = ""
    timeout_s: float = Field(default=1.0, gt=0, le=10)
    watchdog_s: float = Field(default=3.0, ge=1, le=60)
    baud: int = Field(default=9600, ge=300, le=4_000_000)
    clockwise_is_positive: bool = False
    limits: Limits
    commands: Commands
    replies: Replies


def described(name: str | Path) -> Description:
    """The description of that file, or the one that comes with gyrofree under the name; raises
    TableError.
    """
    path = DESCRIPTIONS / f"{name}.toml"
    path = path if path.is_file() else Path(name)
    try:
        return Description.model_validate(parsed(text_of(path)))
    except OSError as error:
        there = ", ".join(sorted(one.stem for one in DESCRIPTIONS.glob("*.toml")))
        raise TableError(f"{path}: {error.strerror}; want a file, or one of {there}") from None
    except tomllib.TOMLDecodeError as error:
        raise TableError(f"{path}: not TOML: {error}") from None
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise TableError(f"{path}: {where}: {first['msg']}") from None


class TextTable:
    """A table over a serial line, or tcp://host:port, that is opened when it is needed."""

    def __init__(self, description: Description, port: str) -> None:
        self._said, self._port = description, port
        self._per_unit = PER_UNIT[description.unit] * (
            -1.0 if description.clockwise_is_positive else 1.0
        )
        self._line: serial.SerialBase | None = None
        self._lock = threading.Lock()
        self._guard = Guard(description.model_dump_json(), port)
        self._let_go = threading.Event()  # set: nobody is kept alive

    @property
    def name(self) -> str:
        """Of the description."""
        return self._said.title

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
        """See RateTable; waits for nobody longer than one answer."""
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
        line, end = self._open(), self._said.terminator.encode()
        line.reset_input_buffer()
        line.write(command.encode() + end)
        if not answered:
            return ""
        until, told = time.monotonic() + self._said.timeout_s, b""
        while not told.endswith(end):
            told += line.read(1) if len(told) < LONGEST else b""
            if time.monotonic() > until or len(told) >= LONGEST:
                heard = repr(told[:80].decode(errors="replace")) if told else "nothing"
                raise TableError(
                    f"{self.name} on {self._port}: {command!r} was answered by {heard} within "
                    f"{self._said.timeout_s:g} s"
                )
        return told.decode(errors="replace").strip()

    def _open(self) -> serial.SerialBase:
        if self._line is None:
            url = self._port.replace("tcp://", "socket://", 1)
            self._line = serial.serial_for_url(url, baudrate=self._said.baud, timeout=0.1)
        return self._line

    def _close(self) -> None:
        if self._line is not None:
            self._line.close()
            self._line = None
