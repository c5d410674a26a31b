"""Serial ports of this machine, and what speaks on each at which baud."""

import os
import select
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from serial.tools import list_ports

from firmware_protocol.codec import encode
from firmware_protocol.frames import Command
from firmware_protocol.spec import SPEC
from gateway.ports.ports import Port, PortError, open_port
from gyrofree.setup.ear import BOARD, SANE, SILENCE, Ear

BY_ID = Path("/dev/serial/by-id")
BAUDS = (921600, 115200, 9600, 38400, 460800, 230400, 57600, 1_000_000, 2_000_000, 3_000_000, 4800)
LISTEN_S = 3.0  # at a baud where something sane speaks, or where nothing has come
TRY_S = 1.3  # at each other baud; receivers speak once a second
HELLO = next(entry["id"] for entry in SPEC.raw["command"] if entry["name"] == "hello")


@dataclass(frozen=True)
class Found:
    """What was heard on a port."""

    port: str
    baud: int  # bit/s, where something sane was heard; else the first tried
    ear: Ear | None  # None: it could not be opened
    fault: str = ""  # why not
    tried: dict[int, int] = field(default_factory=dict)  # bit/s -> bytes, where nothing was sane

    @property
    def kind(self) -> str:
        """Of the speaker (ear.py); "closed" where the port could not be opened."""
        return self.ear.kind if self.ear else "closed"

    @property
    def said(self) -> str:
        """In words."""
        if self.ear is None:
            return self.fault
        if self.kind in SANE:
            return self.ear.said
        if self.kind == SILENCE:
            return "silence: is the board powered, its transmit line connected?"
        bauds = ", ".join(f"{baud}" for baud in self.tried)
        return f"{self.ear.said}; nothing sane at {bauds} baud: noise, or a baud of its own"

    def as_dict(self) -> dict:
        """For JSON."""
        row = {"port": self.port, "baud": self.baud, "kind": self.kind, "said": self.said}
        if self.ear is not None and self.kind == BOARD:
            board = self.ear.board
            row |= {
                "board": board.kind,
                "axes": board.axes,
                "rate_hz": round(1.0 / board.period_s, 6) if board.period_s else None,
                "pulses": board.pulses,
                "receiver": sorted(board.messages),
            }
        return row


def names(by_id: Path = BY_ID) -> list[str]:
    """Ports by the names that stay: by-id where there is one, then the kernel's."""
    kept = sorted(by_id.glob("*")) if by_id.is_dir() else []
    real = {os.path.realpath(path) for path in kept}
    others = []
    if by_id == BY_ID:
        others = [port.device for port in list_ports.comports()]
    return [*map(str, kept), *(o for o in sorted(others) if os.path.realpath(o) not in real)]


def has_baud(port: str) -> bool:
    """False for ptys, sockets and files, where there is but one way to listen."""
    if "://" in port:
        return port.startswith("rfc2217://")
    return not os.path.realpath(port).startswith("/dev/pts/")


def listen(
    port: str,
    baud: int | None = None,
    seconds: float = LISTEN_S,
    told: Callable[[str], object] = lambda _: None,
) -> Found:
    """Listen at one baud, or without it at all usual ones until something sane speaks.

    told: is given a word before each try. A line that is silent is so at every baud.
    """
    tried: dict[int, int] = {}
    first: Ear | None = None
    for one in _bauds(port, baud):
        told(f"{port}: listening" + (f" at {one} baud" if has_baud(port) else ""))
        try:
            ear = _hear(port, one, seconds if first is None else min(seconds, TRY_S), seconds)
        except (PortError, ValueError) as error:
            return Found(port, one, None, str(error))
        if ear.kind in SANE:
            return Found(port, one, ear, tried=tried)
        tried[one] = ear.bytes
        first = first or ear
        if first.kind == SILENCE:
            break
    return Found(port, next(iter(tried)), first, tried=tried)


def _bauds(port: str, baud: int | None) -> Iterator[int]:
    if baud is not None:
        yield baud
    elif not has_baud(port):
        yield BAUDS[0]
    else:
        yield from BAUDS


def _hear(port: str, baud: int, patience: float, whole: float) -> Ear:
    """What speaks within `patience` s; `whole` s of it once it is sane."""
    ear, source = Ear(), open_port(port, baud)
    asked, begun = False, time.monotonic()
    end = begun + patience
    try:
        while (left := end - time.monotonic()) > 0:
            if not select.select([source.fileno()], [], [], left)[0]:
                break
            try:
                ear.feed(source.read())
            except PortError:
                if ear.bytes:
                    break  # a file's end, or unplugged: it has said what it said
                raise
            if ear.frames:
                end = begun + max(whole, patience)
                if not asked and ear.board.hello is None:
                    asked = True
                    _ask_who(source)
    finally:
        source.close()
    return ear


def _ask_who(source: Port) -> None:
    """A board says who it is every ten seconds, and when it is asked."""
    try:
        source.write(encode(Command(HELLO, 1), epoch=0, seq=0, t_us=0))
    except PortError:
        pass  # a line that cannot be written to; it will say so in time
