"""Fixes with their two times: arrival at the board (or host), and the fix itself on the board's
clock.

A receiver reports a fix 30 to 200 ms late, and never by the same amount. The device time of a fix
is found as the host finds the board's: by the lower envelope of arrival against time of fix. What
remains is the shortest delay, `latency_s`, which cannot be seen from here.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from gateway.gnss.decoder import GnssDecoder
from gateway.gnss.fix import Fix, unroll_weeks
from gateway.time.clock import DeviceClock


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
        self.decoder = GnssDecoder()
        self._latency_s = latency_s
        self._first_us = 0
        self._first_ns: int | None = None
        self.restart()

    def restart(self) -> None:
        """The board's clock begins again; the receiver's goes on."""
        self._clock = DeviceClock()

    def feed(
        self, data: bytes, device_us: int, monotonic_ns: int | None, utc_ns: int
    ) -> Iterator[Arrival]:
        """Fixes completed by these bytes, which came at device_us. utc_ns: now, against week
        rollover.
        """
        if self.decoder.idle:
            self._first_us, self._first_ns = device_us, monotonic_ns
        for fix in self.decoder.feed(data):
            fix = replace(fix, fix_utc_ns=unroll_weeks(fix.fix_utc_ns, utc_ns))
            yield Arrival(fix, self._first_us, self._first_ns, self._device_time(fix))
            self._first_us, self._first_ns = (
                device_us,
                monotonic_ns,
            )  # what follows it came with these bytes

    def _device_time(self, fix: Fix) -> float:
        if not fix.fix_utc_ns or not self._first_us:
            return 0.0
        fix_us = fix.fix_utc_ns // 1000
        self._clock.add(fix_us, self._first_us * 1000)
        return self._clock.host_ns(fix_us) / 1e9 - self._latency_s
