"""Fixes with their two times: arrival at the board (or host), and the fix itself on the board's
clock.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from gateway.gnss.decoder import GnssDecoder
from gateway.gnss.fix import Fix, plausible_utc, unroll_weeks
from gateway.gnss.receiver_clock import ReceiverClock


@dataclass(frozen=True)
class Arrival:
    """A fix, when its first byte came, and when it was true. monotonic_ns: None inside GPS
    frames.
    """

    fix: Fix
    device_us: int
    monotonic_ns: int | None
    device_time_s: float  # 0: unknown


class GnssLink:
    """One receiver, wherever its bytes come from."""

    def __init__(self, latency_s: float = 0.0) -> None:
        """latency_s: the shortest delay of a fix, which cannot be seen from here."""
        self.decoder = GnssDecoder()
        self.clock = ReceiverClock()
        self._latency_s = latency_s

    def restart(self) -> None:
        """The board's clock begins again; the receiver's goes on."""
        self.clock.restart()

    def feed(
        self, data: bytes, device_us: int, monotonic_ns: int | None, utc_ns: int
    ) -> Iterator[Arrival]:
        """Fixes completed by these bytes, which came at device_us. utc_ns: now, against week
        rollover.
        """
        for fix in self.decoder.feed(data, (device_us, monotonic_ns)):
            fix_utc_ns = plausible_utc(unroll_weeks(fix.fix_utc_ns, utc_ns))
            fix = replace(fix, fix_utc_ns=fix_utc_ns)
            first_us, first_ns = fix.began or (device_us, monotonic_ns)
            yield Arrival(fix, first_us, first_ns, self._device_time(fix, first_us))

    def _device_time(self, fix: Fix, first_us: int) -> float:
        if not first_us:
            return 0.0
        at_us = self.clock.device_us(fix, first_us)
        return 0.0 if at_us is None else at_us / 1e6 - self._latency_s
