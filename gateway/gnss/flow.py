"""Bytes of a receiver, in frames or on a port of its own, become fixes as messages."""

import time

from gateway.board.outgoing import Outgoing
from gateway.gnss.link import GnssLink
from gateway.samples import convert
from gateway.time.wall import WallClock
from messages.contract.topics import GNSS, LOCATION


class GnssFlow:
    """The receiver of one board."""

    def __init__(self, device: str, latency_s: float, wall: WallClock, out: Outgoing) -> None:
        self._device, self._wall, self._out = device, wall, out
        self._link = GnssLink(latency_s)

    @property
    def good(self) -> int:
        """Messages of the receiver that were sound."""
        return self._link.decoder.good

    @property
    def bad(self) -> int:
        """Messages of the receiver that were damaged."""
        return self._link.decoder.bad

    def restart(self) -> None:
        """The board has booted; the receiver goes on."""
        self._link.restart()

    def take(self, data: bytes, device_us: int, monotonic_ns: int | None) -> None:
        """Bytes that came at device_us; monotonic_ns: None inside GPS frames."""
        for arrival in self._link.feed(data, device_us, monotonic_ns, time.time_ns()):
            message = convert.gnss_fix(arrival.fix)
            message.device_time_s = arrival.device_time_s
            at_ns = arrival.monotonic_ns
            utc_ns = None if at_ns is None else self._wall.utc_ns(at_ns)
            self._out.publish(GNSS, message, arrival.device_us, utc_ns)
            if message.quality:
                self._out.send(LOCATION, convert.location_fix(message, self._device))
