"""Orders to a board: CMD out, ACK back, an answer for the one who asked, also when none comes.

Everything happens on the thread of the device's link, except `ask`, which any thread may call.
"""

import logging
import queue
import struct
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass

from firmware_protocol.codec import encode
from firmware_protocol.frames import Ack, Command
from firmware_protocol.spec import SPEC
from gateway.ports.ports import PortError
from messages.contract import gyrofree_pb2 as pb

log = logging.getLogger(__name__)

ANSWER_S = 1.0  # an ACK comes within milliseconds
SLOW = {"self_test": 4.0}  # s, of commands that take their time
COMMANDS = {entry["name"]: entry["id"] for entry in SPEC.raw["command"]}
SETTINGS = {entry["name"]: entry["id"] for entry in SPEC.raw["setting"]}
RESULTS = {entry["id"]: entry for entry in SPEC.raw["result"]}
UNITS = {entry["name"]: entry.get("unit", "") for entry in SPEC.raw["setting"]}
TRIADS = 4


@dataclass
class _Open:
    name: str
    answer: Future
    until: float  # time.monotonic(), s


class Orders:
    """Commands under way to one board."""

    def __init__(self, device: str, send: Callable[[bytes], None]) -> None:
        """send: writes to the port or raises PortError."""
        self._device, self._send = device, send
        self._asked: queue.SimpleQueue[tuple[str, int | None, Future]] = queue.SimpleQueue()
        self._open: dict[int, _Open] = {}
        self._token = 0
        self.timeouts = 0

    def ask(self, name: str, value: int | None = None) -> "Future[pb.Reply]":
        """Order something by its name in the wire specification; value None: an action, or to read
        a setting.

        The link's thread sends it at its next turn: wake it.
        """
        answer: Future[pb.Reply] = Future()
        self._asked.put((name, value, answer))
        return answer

    def step(self, now: float) -> None:
        """Send what was asked, give up what got no answer."""
        while not self._asked.empty():
            self._order(*self._asked.get(), now)
        for token, order in list(self._open.items()):
            if now >= order.until:
                del self._open[token]
                self.timeouts += 1
                order.answer.set_result(
                    pb.Reply(
                        ok=False,
                        message=(
                            f"{self._device}: no ACK to {order.name}: the board does not listen; is"
                            " its receive line connected, and does its firmware know commands?"
                        ),
                    )
                )

    @property
    def waiting(self) -> bool:
        """True while an answer is due."""
        return bool(self._open) or not self._asked.empty()

    def take(self, ack: Ack) -> None:
        """An ACK has come."""
        order = self._open.pop(ack.token, None)
        if order is not None:
            order.answer.set_result(reply(order.name, ack))

    def close(self) -> None:
        """Nobody will answer any more."""
        for _ in range(self._asked.qsize()):
            self._asked.get()[2].set_result(
                pb.Reply(ok=False, message=f"{self._device}: the gateway stops")
            )
        for order in self._open.values():
            order.answer.set_result(
                pb.Reply(ok=False, message=f"{self._device}: the gateway stops")
            )
        self._open.clear()

    def _order(self, name: str, value: int | None, answer: Future, now: float) -> None:
        number = COMMANDS.get(name, SETTINGS.get(name))
        if number is None:
            known = ", ".join([*COMMANDS, *SETTINGS])
            answer.set_result(
                pb.Reply(ok=False, message=f"no command {name!r}; a board knows {known}")
            )
            return
        if name in SETTINGS and value is not None and not 0 <= value < 1 << 32:
            answer.set_result(
                pb.Reply(ok=False, message=f"{name} = {value}: want 0 to {(1 << 32) - 1}")
            )
            return
        arguments = struct.pack("<I", value) if name in SETTINGS and value is not None else b""
        self._token = self._token % 0xFFFF + 1
        frame = encode(Command(number, self._token, arguments), epoch=0, seq=self._token, t_us=0)
        try:
            self._send(frame)
        except PortError as error:
            answer.set_result(pb.Reply(ok=False, message=str(error)))
            return
        self._open[self._token] = _Open(name, answer, now + SLOW.get(name, ANSWER_S))


def reply(name: str, ack: Ack) -> pb.Reply:
    """An ACK in words."""
    if ack.status == 0:
        return pb.Reply(ok=True, message=_done(name, ack.echo))
    result = RESULTS.get(ack.status)
    why = result["text"] if result else f"status {ack.status}, which this version does not know"
    value = _setting(name, ack.echo)
    return pb.Reply(ok=False, message=f"{name}: refused: {why}" + (f" ({value})" if value else ""))


def _setting(name: str, echo: bytes) -> str:
    if name not in SETTINGS or len(echo) < 4:
        return ""
    return f"{name} is {struct.unpack_from('<I', echo)[0]} {UNITS[name]}".rstrip()


def _done(name: str, echo: bytes) -> str:
    if name in SETTINGS:
        return _setting(name, echo) or f"{name}: done"
    if name == "time" and len(echo) >= 16:
        read_us, built_us = struct.unpack_from("<QQ", echo)
        return (
            f"the board's clock shows {read_us / 1e6:.6f} s; it answered after"
            f" {built_us - read_us} us"
        )
    if name == "self_test" and len(echo) >= 2:
        passed, tested = echo[0], echo[1]
        words = [
            f"triad {k + 1}"
            f" {'passed' if passed >> k & 1 else 'FAILED' if tested >> k & 1 else 'not tested'}"
            for k in range(TRIADS)
        ]
        return "self-test: " + ", ".join(words)
    return f"{name}: done"
