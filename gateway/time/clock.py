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
JUMP_COUNT = 20  # so many in a row: the device's clock jumped ...
JUMP_SETTLE_NS = 3_000_000_000  # ... when, being late, they have not caught up for so long
WRAP_BITS = 32  # of a board's counter of microseconds that begins again after 71.6 minutes
WRAP_DOUBT_US = 60_000_000  # a wrap is one when the board goes on within this


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
        self._least_far, self._settled_ns = 0.0, 0  # how late at least, and since when not less
        self._doubt_s = 0.0  # newest receipts contradict the line by this
        self.residual_s = 0.0
        self.span_s = 0.0

    @property
    def started(self) -> bool:
        """True from the first receipt on."""
        return self._line is not None

    def add(self, device_us: int, host_ns: int, late: bool = False) -> None:
        """One receipt: device time of the frame and host monotonic time of its last byte.

        `late`: this process had been stopped, and the byte may have waited for it since. Such a
        receipt says nothing of the clock but that it was not sent after it.
        """
        if self._line is None:
            self._base_us, self._base_ns = device_us, host_ns
            self._line = Line(0.0, 0.0, 0.0)
            self._buckets.append([0.0, 0.0])
            return
        x = (device_us - self._base_us) / 1e6 / self.time_scale
        y = (host_ns - self._base_ns) / 1e9 - x
        above = y - self._line.at(x)
        if late and above > 0.0:
            return
        if self._jumped(above, host_ns):
            self.reset()
            self.add(device_us, host_ns)
            self._doubt_s = abs(above)  # which of the two was right is not known
            return
        if self._far:
            return  # a glitch, a backlog or a jump: the next ones tell
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
            return self.residual_s + SLOPE_PRIOR * max(self.span_s, BUCKET_S) + self._doubt_s
        return max(self.residual_s, 1e-6) + self._doubt_s

    def _jumped(self, above: float, host_ns: int) -> bool:
        """Does this receipt prove that the device's clock jumped? Too early, it does after a few;
        too late, it may be one of many that waited somewhere and are being caught up with.
        """
        limit = max(JUMP_S, 20 * self.residual_s)
        if abs(above) <= limit:
            if self._far or self.span_s >= SLOPE_AFTER_S:
                self._doubt_s = 0.0
            self._far = 0
            return False
        if not self._far or above < self._least_far - 0.05 * limit:
            self._least_far, self._settled_ns = above, host_ns
        self._far += 1
        self._doubt_s = abs(above)
        waited = above < 0.0 or host_ns - self._settled_ns >= JUMP_SETTLE_NS
        if self._far < JUMP_COUNT or not waited:
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


class Continued:
    """Device time, continued over the wraps of a counter of 32 bits; a clock of 64 bits passes
    through as it is.
    """

    def __init__(self) -> None:
        self._wraps = 0
        self._newest: int | None = None  # continued, us

    def take(self, t_us: int) -> int:
        """The time of a frame, us, as one that does not begin again."""
        newest = self._newest
        if newest is not None and t_us < 1 << WRAP_BITS and newest >= 1 << (WRAP_BITS - 1):
            near = unwrap(newest, t_us, WRAP_BITS)
            if self._wraps or 0 <= near - newest <= WRAP_DOUBT_US:
                self._wraps = max(self._wraps, near >> WRAP_BITS)
                t_us = near
        self._newest = t_us if newest is None else max(newest, t_us)
        return t_us
