"""Device time to host time by the lower envelope.

Every frame arrives late by an unknown, never negative delay, so the line under all points (device
time, receipt) is the clock and the scatter above it is the transport. Least squares would take the
scatter for skew: with a 16 ms USB latency timer over 60 s its error was 8.9 ppm against 1.9 ppm. Of
all lines below the points the one nearest to them on average is the edge of the lower convex hull
above the mean device time (Moon, Skelly, Towsley: Estimation and removal of clock skew, 1999).

The fixed path delay cannot be seen one-way: it is in the offset, not in `sigma_s`.
"""

from collections import deque
from dataclasses import dataclass

BUCKET_S = (
    0.5  # of each such piece of time only the earliest receipt is kept: 120 points in a minute
)
SLOPE_AFTER_S = 10.0  # before that scatter / span says nothing about skew
SLOPE_PRIOR = 100e-6  # a crystal's tolerance, used until then
LEAST_SLOPE = -0.999  # a device that runs a thousand times as fast as the host; -1 has no inverse
JUMP_S = 1.0  # a receipt this far from the line is no delay any more
JUMP_COUNT = 20  # so many in a row: the device's clock jumped


def lower_hull(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Lower convex hull, left to right, of points sorted by x (Andrew's monotone chain)."""
    hull: list[tuple[float, float]] = []
    for x, y in points:
        while len(hull) > 1:
            (x0, y0), (x1, y1) = hull[-2], hull[-1]
            if (x1 - x0) * (y - y0) > (y1 - y0) * (x - x0):
                break
            hull.pop()
        hull.append((x, y))
    return hull


@dataclass(frozen=True)
class Line:
    """receipt - device / scale = offset_s + slope * (device - origin), all in host seconds."""

    origin_s: float
    offset_s: float
    slope: float

    def at(self, x: float) -> float:
        """Value at device time x, s."""
        return self.offset_s + self.slope * (x - self.origin_s)


class DeviceClock:
    """The map from one device clock to one host clock, learnt from receipts.

    time_scale: device seconds per host second; 1 for a real board, N for a log that is played at N
    times its speed. Skew is stated against it.
    """

    def __init__(self, window_s: float = 60.0, time_scale: float = 1.0) -> None:
        self.window_s = window_s
        self.time_scale = time_scale
        self.jumps = 0
        self.reset()

    def reset(self) -> None:
        """Forget everything: the board has restarted."""
        self._buckets: deque[list[float]] = deque()  # [x, y] in s: earliest receipt of each piece
        self._base_us = (
            0  # both clocks are counted from the first point, so floats keep nanoseconds
        )
        self._base_ns = 0
        self._line: Line | None = None
        self._far = 0
        self.residual_s = 0.0
        self.span_s = 0.0

    @property
    def started(self) -> bool:
        """True from the first receipt on."""
        return self._line is not None

    def add(self, device_us: int, host_ns: int) -> None:
        """One receipt: device time of the frame and host monotonic time of its last byte."""
        if self._line is None:
            self._base_us, self._base_ns = device_us, host_ns
            self._line = Line(0.0, 0.0, 0.0)
            self._buckets.append([0.0, 0.0])
            return
        x = (device_us - self._base_us) / 1e6 / self.time_scale
        y = (host_ns - self._base_ns) / 1e9 - x
        above = y - self._line.at(x)
        if self._jumped(above):
            self.reset()
            self.add(device_us, host_ns)
            return
        newest = self._buckets[-1]
        if x < newest[0] - self.window_s:
            return  # out of order by more than a window: nothing to learn
        if int(x // BUCKET_S) > int(newest[0] // BUCKET_S):
            self._fit()
            self._buckets.append([x, y])
            while self._buckets[0][0] < x - self.window_s:
                self._buckets.popleft()
        elif y - self._line.slope * x < newest[1] - self._line.slope * newest[0] and x >= newest[0]:
            newest[0], newest[1] = x, y
        if above < 0.0:  # earlier than the envelope thought possible: it goes down at once
            self._fit()

    def host_ns(self, device_us: int) -> int:
        """Host monotonic time of a device time, ns; 0 before the first receipt."""
        if self._line is None:
            return 0
        x = (device_us - self._base_us) / 1e6 / self.time_scale
        whole = round((device_us - self._base_us) * 1000 / self.time_scale)
        return self._base_ns + whole + round(self._line.at(x) * 1e9)

    def device_us(self, host_ns: int) -> int:
        """Device time at a host monotonic time, us; 0 before the first receipt."""
        if self._line is None:
            return 0
        t = (host_ns - self._base_ns) / 1e9
        x = (t - self._line.offset_s + self._line.slope * self._line.origin_s) / (
            1.0 + self._line.slope
        )
        return self._base_us + round(x * self.time_scale * 1e6)

    @property
    def skew_ppm(self) -> float:
        """Device clock against the host's, ppm; positive when the device runs fast."""
        return 0.0 if self._line is None else (1.0 / (1.0 + self._line.slope) - 1.0) * 1e6

    @property
    def sigma_s(self) -> float:
        """One sigma of the mapping without the fixed path delay, s."""
        if self.span_s < SLOPE_AFTER_S:
            return self.residual_s + SLOPE_PRIOR * max(self.span_s, BUCKET_S)
        return max(self.residual_s, 1e-6)

    def _jumped(self, above: float) -> bool:
        limit = max(JUMP_S, 20 * self.residual_s)
        self._far = self._far + 1 if abs(above) > limit else 0
        if self._far < JUMP_COUNT:
            return False
        self.jumps += 1
        return True

    def _fit(self) -> None:
        points = [(x, y) for x, y in self._buckets]
        self.span_s = points[-1][0] - points[0][0]
        mean = sum(x for x, _ in points) / len(points)
        slope = 0.0
        if self.span_s >= SLOPE_AFTER_S:
            hull = lower_hull(points)
            for (x0, y0), (x1, y1) in zip(hull, hull[1:], strict=False):
                slope = (y1 - y0) / (x1 - x0)
                if x1 >= mean:
                    break
        slope = max(slope, LEAST_SLOPE)
        offset = min(y - slope * (x - mean) for x, y in points)
        self._line = Line(mean, offset, slope)
        above = [y - self._line.at(x) for x, y in points]
        self.residual_s = (sum(a * a for a in above) / len(above)) ** 0.5


def unwrap(previous: int, counter: int, bits: int = 32) -> int:
    """The counter continued over its wraps: the value nearest to `previous` that agrees modulo
    2^bits.
    """
    half, whole = 1 << (bits - 1), 1 << bits
    return previous + (counter - previous + half) % whole - half
