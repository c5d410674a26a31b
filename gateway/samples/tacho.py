"""Tachometer pulses to rate.

n pulses apart by the pitch d = 2 pi / pulses per turn in the time T: |omega| = n d / T. Errors: an
edge is timed with TIME_SIGMA and a mark stands off its place by MARK_SIGMA pitches, both at either
end, so

    sigma = |omega| sqrt(2) sqrt((TIME_SIGMA / T)^2 + (MARK_SIGMA / n)^2)

Silence bounds the rate: no pulse for g seconds means |omega| < d / g, either way round. A uniform
density between the bounds has mean 0 and sigma d / (g sqrt(3)), and that is what is reported once
the silence lasts longer than SILENT_INTERVALS intervals.
"""

import math
from dataclasses import dataclass

TIME_SIGMA = 1e-6  # s, capture resolution 10 ns plus the slope of an optical edge
MARK_SIGMA = 0.02  # of a pitch, printed or milled marks
SILENT_INTERVALS = 3.0
MOST_PULSES = 100_000  # remembered until the rate is asked for
FRAME_DELAY_S = 0.06  # pulses wait in the board for their frame: silence shorter than this is none


@dataclass(frozen=True)
class Rate:
    """A rate about the table's axis, at the newest pulse or, in silence, at the time asked for."""

    device_us: float
    omega_radps: float
    sigma_radps: float
    direction_known: bool


class Tachometer:
    """Pulses of one board since its boot."""

    def __init__(self, pulses_per_rev: int) -> None:
        self.pitch_rad = 2.0 * math.pi / pulses_per_rev
        self.reset()

    def reset(self) -> None:
        """The board has restarted."""
        self.pulses = 0
        self._times: list[
            float
        ] = []  # us, of the pulses since the last report and the one before them
        self._sign = 1.0
        self._known = False
        self._interval_us = 0.0

    def add(self, times_us: list[float], direction_known: bool, negative: bool) -> None:
        """Pulses of one frame, in order. A change of direction starts anew: the pulses around it
        are no interval.
        """
        if not times_us:
            return
        sign = -1.0 if direction_known and negative else 1.0
        if sign != self._sign or direction_known != self._known:
            self._times.clear()
        self._sign, self._known = sign, direction_known
        self.pulses += len(times_us)
        self._times.extend(times_us)
        del self._times[:-MOST_PULSES]

    def rate(self, now_us: float) -> Rate | None:
        """The rate that the pulses since the last call say; None when they say nothing new."""
        if not self._times:
            return None
        first, last, n = self._times[0], self._times[-1], len(self._times) - 1
        if n and last > first:
            span_s = (last - first) / 1e6
            self._interval_us = (last - first) / n
            self._times = [last]
            omega = n * self.pitch_rad / span_s
            sigma = omega * math.sqrt(2.0) * math.hypot(TIME_SIGMA / span_s, MARK_SIGMA / n)
            return Rate(last, self._sign * omega, sigma, self._known)
        return self._silence(last, now_us)

    def _silence(self, last_us: float, now_us: float) -> Rate | None:
        gap_us = now_us - last_us
        if gap_us < SILENT_INTERVALS * self._interval_us or gap_us < FRAME_DELAY_S * 1e6:
            return None
        bound = self.pitch_rad / (gap_us / 1e6)
        return Rate(now_us, 0.0, bound / math.sqrt(3.0), self._known)
