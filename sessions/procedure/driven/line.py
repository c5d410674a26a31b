"""The line to a table that speaks in text: a serial port, or tcp://host:port."""

import fcntl
import os
import select
import time

import serial

LONGEST = 4096  # bytes of one reply
LOOK_S = 0.1  # of one look whether there is something to read, or room to write
DRAIN_S = 0.2
BUSY_S = 3.0  # that a line may be held by another


class Patience:
    """A time limit of `limit_s`, in looks of LOOK_S at most. A process that is stopped, or that a
    busy machine gives no time, saw nothing meanwhile: this counts as one look and not as silence of
    the table.
    """

    def __init__(self, limit_s: float) -> None:
        self._left_s, self._looked = limit_s, time.monotonic()

    def over(self) -> bool:
        """To be asked before each look."""
        before, self._looked = self._looked, time.monotonic()
        self._left_s -= min(self._looked - before, LOOK_S)
        return self._left_s <= 0.0


def opened(port: str, baud: int) -> serial.SerialBase:
    """A line of one's own. Raises OSError, serial.SerialException."""
    line = serial.serial_for_url(
        port.replace("tcp://", "socket://", 1), baudrate=baud, timeout=LOOK_S
    )
    _alone(line)
    return line


def _alone(line: serial.SerialBase) -> None:
    """Have a line to oneself: who is about to leave it, as the guard after a stop, still gets its
    answer and takes none of ours. One that hangs is not waited for long: a stop must get through.
    """
    until = time.monotonic() + BUSY_S
    while isinstance(line, serial.Serial) and time.monotonic() < until:
        try:
            fcntl.flock(line.fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            time.sleep(0.02)
        else:
            return


def drain(line: serial.SerialBase) -> None:
    """Forget what was said before, but not for ever where somebody pours."""
    if isinstance(line, serial.Serial):
        line.reset_input_buffer()
        return
    until = time.monotonic() + DRAIN_S
    while line.in_waiting and time.monotonic() < until:
        line.read(LONGEST)


def send(line: serial.SerialBase, command: bytes, limit_s: float) -> None:
    """All of it; raises serial.SerialTimeoutException when the other side takes none for `limit_s`.

    pyserial's own limit is of the clock alone: it calls a command that went out a failure, where
    the process was stopped just then.
    """
    patience = Patience(limit_s)
    while command:
        over, took = patience.over(), _put(line.fileno(), command)
        if over and not took:
            raise serial.SerialTimeoutException(f"it takes nothing for {limit_s:g} s")
        command = command[took:]


def _put(fd: int, command: bytes) -> int:
    """One look; how many bytes of it there was room for."""
    if not select.select([], [fd], [], LOOK_S)[1]:
        return 0
    try:
        return os.write(fd, command)
    except BlockingIOError:
        return 0
