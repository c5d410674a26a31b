"""How much a running process logs: changed by an order over the bus, or by SIGUSR1 where there is
no bus, and as configured again after a while.
"""

import logging
import os
import socket
import threading
from dataclasses import dataclass
from typing import Any

import zenoh

from messages.bus import orders
from messages.contract import gyrofree_pb2 as pb
from messages.text import plain

LEVELS = ("debug", "info", "warning", "error")
BY_SIGNAL_S = 600.0  # that SIGUSR1 holds

log = logging.getLogger(__name__)


class LogLevel:
    """The level of this process; for any thread."""

    def __init__(self, logger: logging.Logger | None = None) -> None:
        """logger: the root by default, whose level now is what is configured."""
        self._logger = logger or logging.getLogger()
        self._configured = self._logger.level
        self._timer: threading.Timer | None = None
        self._lock = threading.Lock()

    @property
    def name(self) -> str:
        """In force now."""
        return logging.getLevelName(self._logger.level).lower()

    def set(self, level: str, seconds: float, who: str) -> str:
        """Change it, for `seconds` or (0) until the process ends; "": as configured. What is so
        now, in words. Raises ValueError for a level that is none.
        """
        if level and level not in LEVELS:
            raise ValueError(f"level {level[:20]!r}: want one of {', '.join(LEVELS)}")
        with self._lock:
            self._stop()
            self._logger.setLevel(level.upper() if level else self._configured)
            if level and seconds:
                self._timer = threading.Timer(seconds, self.set, ("", 0.0, "its time is over"))
                self._timer.daemon = True
                self._timer.start()
        told = f"log level {self.name}" + (f" for {seconds:g} s" if level and seconds else "")
        # as a warning, so that it stands in every log
        log.warning("%s, by %s", told, plain(who, 80))
        return told

    def toggle(self) -> None:
        """By a signal: everything for ten minutes, or as configured again."""
        detailed = self._logger.level <= logging.DEBUG
        self.set("" if detailed else "debug", BY_SIGNAL_S, "SIGUSR1")

    def close(self) -> None:
        """Forget what was to come."""
        with self._lock:
            self._stop()

    def answer(self, order: orders.Order[pb.LogLevelCommand, pb.Reply]) -> None:
        """Carry out an order."""
        command = order.command
        try:
            told = self.set(command.level, command.seconds, command.user or "somebody")
        except ValueError as error:
            order.refuse(str(error))
            return
        order.answer(pb.Reply(ok=True, message=f"{socket.gethostname()} {os.getpid()}: {told}"))

    def listen(self, session: zenoh.Session, bus: Any) -> zenoh.Queryable:
        """Take orders on a session of this process; `bus` is its BusSettings."""
        return orders.take(session, bus.prefix, orders.LOG_LEVEL, self.answer, bus.role)

    def _stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


@dataclass(frozen=True)
class Answer:
    """Of one process."""

    ok: bool
    text: str


def ask(
    session: zenoh.Session, prefix: str, service: str, command: pb.LogLevelCommand
) -> list[Answer]:
    """Give the order to every process of a service, of which there may be several (gateways)."""
    replies = session.get(
        orders.LOG_LEVEL.key(prefix, service),
        payload=command.SerializeToString(),
        timeout=orders.LOG_LEVEL.patience_s,
        target=zenoh.QueryTarget.ALL,
        consolidation=zenoh.ConsolidationMode.NONE,
    )
    found: dict[str, Answer] = {}  # once for each process, which may have several sessions
    for reply in replies:
        if reply.ok is not None:
            text = plain(pb.Reply.FromString(reply.ok.payload.to_bytes()).message, 300)
            found[text] = Answer(True, text)
        elif reply.replier_id is not None:
            text = plain(reply.err.payload.to_bytes().decode(errors="replace"), 300)
            found[text] = Answer(False, text)
    return list(found.values())
