"""Is the body still? Questions on the newest samples, with stated limits (E-20 to E-25).

    spread    do the axes scatter more than their noise?                   chi-square of N (window -
    1) degrees quiet     do the mean omega' and products of two windows differ
              from those of the last standstill?                           chi-square of 3 + m
              degrees
    turn      does omega', summed over 4 to 128 samples, differ from the
              bias of this standstill? Sees a slow start early.            chi-square of 3 degrees
              at each length
    tilt      does p differ from that of this standstill?                  chi-square of 3 degrees
    steady    is p now what it was a second ago? Gravity turns in a body
              that turns slowly about an axis that is not quite vertical.  chi-square of 3 degrees
    rate      does the caller's rate exclude zero? In doubt: it and
              `steady` together?                                           waived after `patience_s`
              of the others
    biases    when they have moved for good, `quiet` would fail for ever: it is waived after twice
    `patience_s`

`turn` and `tilt` are asked of a body that stands; they end a standstill and say how many samples
ago it ended. A body that turns steadily below about 10 deg/s about an axis within half a degree of
the vertical reads the same as one that
stands: `rate` is for that, and nothing can help when the rate is wrong as well. `steady` takes more
than a second; a caller who knows the rate well, and finds it zero, need not wait for it. Compiled,
deterministic, no time of day.
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from inertial.rate.compiling import lean, making
from inertial.rate.observed import MOST_AXES, Sensor

Array = NDArray[np.float64]

DEPTH = 128  # samples remembered
LENGTHS = np.array([4, 8, 16, 32, 64, 128])  # samples over which omega' is summed
COUNT, FILLED, STILL_FOR, QUIET_FOR, SLOW_FOR, LEARNT, LEARNING, HOLD = range(8)  # of Watch.n


@dataclass(frozen=True)
class Config:
    """Limits of the still detector; false alarms by chance at 100 Hz as measured by
    tests/bench/bench_rate.py.
    """

    sigma_axis: float = (
        0.0408  # m/s^2, one sample of one axis: 4 mg noise and 3.9 mg counts (ADXL345, 100 Hz)
    )
    window: int = 25  # samples
    short_window: int = 8  # samples; notices the start of a turn sooner
    spread_limit: float = (
        1.45  # mean square scatter over sigma_axis^2: 5 sigma above 1 for 12 axes and 25 samples
    )
    quiet_limit: float = 38.0  # chi-square, 9 degrees: once in 50 000 windows by chance
    turn_limit: float = 22.0  # chi-square, 3 degrees: once in 15 000 sums by chance
    tilt_limit: float = 30.0  # chi-square, 3 degrees
    steady_span: int = 100  # samples between the two windows in which p must be the same
    steady_limit: float = 20.0  # chi-square, 3 degrees: once in 6000 windows by chance
    drift_steady: float = 0.003  # m/s^2, of p over steady_span
    rate_limit: float = 16.0  # chi-square, 3 degrees
    rate_slack: float = 0.02  # rad/s, added to the caller's sigma
    sure_rate: float = (
        0.105  # rad/s; a caller whose rate is below it by 2 sigma need not wait for `steady`,
    )
    likely_rate: float = 0.19  # rad/s; below this only for `brief_span`
    brief_span: int = 60  # samples
    begin_limit: float = 18.0  # chi-square, 6 degrees: of `rate` and `steady` together
    patience_s: float = 6.0  # s of stillness by the axes alone that outweigh the caller's rate
    drift: float = 0.02  # 1/s^2, sigma by which biases of the quiet quantities may have moved since
    drift_now: float = 0.004  # rad/s^2, the same within one standstill
    drift_tilt: float = 0.01  # m/s^2, of p within one standstill
    guard: int = 64  # newest samples of a standstill that are not learnt: they may already move
    hold: int = 50  # samples after the end of a standstill before there can be another


# Config for compiled functions.
LIMITS = np.dtype(
    (np.record, [(f.name, "i8" if f.type in (int, "int") else "f8") for f in fields(Config)])
)
Limits = np.record

# Memory of the detector.
WATCH = np.dtype(
    (
        np.record,
        [
            ("a", "f8", (DEPTH, MOST_AXES)),  # ring of readings
            ("dt", "f8", (DEPTH,)),
            ("y", "f8", (DEPTH, 12)),  # of [alpha_m, c_m, p_m]
            ("total", "f8", (2 * DEPTH, 12)),  # running sum of y after each sample
            (
                "square",
                "f8",
                (MOST_AXES, 3),
            ),  # of the readings in the window: offset, sum, sum of squares
            ("reference", "f8", (12,)),  # mean y of the last standstill
            ("gathered", "f8", (12,)),  # of y over this standstill without its newest samples
            ("n", "i8", (8,)),  # counters
        ],
    )
)
Watch = np.record


def limits(config: Config) -> Limits:
    """Config as compiled functions take it. Raises ValueError for windows longer than the
    memory.
    """
    if not 2 <= config.short_window <= config.window <= config.guard < DEPTH:
        raise ValueError(
            f"still detector: windows {config.short_window} <= {config.window} <= {config.guard} <"
            f" {DEPTH}"
        )
    if not 1 <= config.brief_span <= config.steady_span < 2 * DEPTH - config.window:
        raise ValueError(
            f"still detector: spans {config.brief_span} <= {config.steady_span} < {2 * DEPTH} -"
            f" {config.window}"
        )
    out = np.zeros(1, LIMITS)[0]
    for name in LIMITS.names:
        out[name] = getattr(config, name)
    return out


def memory() -> Watch:
    """Nothing seen yet."""
    return np.zeros(1, WATCH)[0]


@lean
def forget(w: Watch) -> None:
    """After a gap: the window must fill anew; the reference of the last standstill stays."""
    w.n[FILLED] = w.n[STILL_FOR] = w.n[QUIET_FOR] = w.n[SLOW_FOR] = w.n[LEARNING] = 0
    w.gathered[:] = 0.0


@lean
def take(w: Watch, s: Sensor, a: Array, dt: float) -> None:
    """Remember one sample."""
    k = w.n[COUNT] % DEPTH
    before = (w.n[COUNT] + 2 * DEPTH - 1) % (2 * DEPTH)
    now = w.n[COUNT] % (2 * DEPTH)
    w.dt[k] = dt
    y = w.y[k]
    for i in range(s.n):
        w.a[k, i] = a[i]
    for r in range(3):
        alpha, force, low, high = (
            0.0,
            0.0,
            0.0,
            0.0,
        )  # rows of B beyond the m that are seen are zero
        for i in range(s.n):
            alpha += s.S[r, i] * a[i]
            force += s.S[3 + r, i] * a[i]
            low += s.B[r, i] * a[i]
            high += s.B[3 + r, i] * a[i]
        y[r], y[3 + r], y[6 + r], y[9 + r] = alpha, low, high, force
    if w.n[FILLED] == 0:
        w.total[before] = 0.0
    for r in range(12):
        w.total[now, r] = y[r] + w.total[before, r]
    w.n[COUNT] += 1
    w.n[FILLED] += 1


@lean
def _scatter(w: Watch, s: Sensor, window: int) -> float:
    """Mean square of the axes about their means over the window, (m/s^2)^2; running sums, made anew
    now and then.
    """
    anew = w.n[FILLED] == window or w.n[COUNT] % DEPTH == 0
    newest, oldest = (w.n[COUNT] - 1) % DEPTH, (w.n[COUNT] - 1 - window) % DEPTH
    total, axes = 0.0, 0.0
    for i in range(s.n):
        sums = w.square[i]
        if anew:
            sums[0], sums[1], sums[2] = w.a[newest, i], 0.0, 0.0
            for k in range(1, window + 1):
                d = w.a[(w.n[COUNT] - k) % DEPTH, i] - sums[0]
                sums[1] += d
                sums[2] += d * d
        else:
            come, gone = w.a[newest, i] - sums[0], w.a[oldest, i] - sums[0]
            sums[1] += come - gone
            sums[2] += come * come - gone * gone
        if s.used[i] > 0.0:
            total += sums[2] - sums[1] * sums[1] / window
            axes += 1.0
    return total / ((window - 1) * axes)


@lean
def _mean(w: Watch, window: int, r: int, ago: int = 0) -> float:
    """Mean of component r of y over the window that ended `ago` samples ago."""
    last = w.n[COUNT] - 1 - ago
    now, then = last % (2 * DEPTH), (last - window) % (2 * DEPTH)
    return (w.total[now, r] - (w.total[then, r] if w.n[FILLED] > window + ago else 0.0)) / window


@making
def _moved(w: Watch, s: Sensor, window: int, drift: float) -> float:
    """Chi-square of the mean [omega', c] of the window against the reference (E-21)."""
    total = 0.0
    share = 1.0 / window + 1.0 / w.n[LEARNT]
    d = np.zeros(9)
    for r in range(3 + s.m):
        d[r] = _mean(w, window, r) - w.reference[r]
    for k in range(9):
        along = 0.0
        for r in range(9):
            along += s.basis[k, r] * d[r]
        total += along * along / (s.spread[k] * share + drift * drift)
    return total


@lean
def _turned(w: Watch, s: Sensor, length: int, drift: float) -> float:
    """Chi-square of the sum of omega' over the newest `length` samples against the bias of this
    standstill (E-23).
    """
    now, then = (w.n[COUNT] - 1) % (2 * DEPTH), (w.n[COUNT] - 1 - length) % (2 * DEPTH)
    share = length * (1.0 + length / w.n[LEARNT])
    total = 0.0
    for r in range(3):
        d = w.total[now, r] - w.total[then, r] - length * w.reference[r]
        total += d * d / (s.R_alpha[r, r] * share + (length * drift) ** 2)
    return total


@lean
def _tilted(w: Watch, s: Sensor, window: int, drift: float) -> float:
    """Chi-square of the mean p of the window against that of this standstill (E-24)."""
    total, share = 0.0, 1.0 / window + 1.0 / w.n[LEARNT]
    for r in range(9, 12):
        total += (_mean(w, window, r) - w.reference[r]) ** 2 / (
            s.R_p[r - 9, r - 9] * share + drift * drift
        )
    return total


@lean
def _swung(w: Watch, s: Sensor, c: Limits, span: int) -> float:
    """Chi-square of the mean p of the window against that of `span` samples ago, which must be
    there (E-24).
    """
    total = 0.0
    for r in range(9, 12):
        d = _mean(w, c.window, r) - _mean(w, c.window, r, span)
        total += d * d / (s.R_p[r - 9, r - 9] * 2.0 / c.window + c.drift_steady**2)
    return total


@lean
def _settled(w: Watch, s: Sensor, c: Limits, omega: Array, P: Array, told: float) -> bool:
    """Has gravity kept its direction for as long as the caller's rate leaves in doubt? told:
    chi-square of `rate`.
    """
    size = np.sqrt(omega[0] * omega[0] + omega[1] * omega[1] + omega[2] * omega[2])
    most = size + 2.0 * np.sqrt(max(P[0, 0], P[1, 1], P[2, 2]))
    if w.n[LEARNT] > 0 and most < c.sure_rate:
        return True
    span = c.brief_span if w.n[LEARNT] > 0 and most <= c.likely_rate else c.steady_span
    if w.n[FILLED] < span + c.window:
        return False
    swung = _swung(w, s, c, span)
    return swung <= c.steady_limit and (told >= c.rate_limit or told + swung < c.begin_limit)


@lean
def rate_excludes_zero(omega: Array, P: Array, slack: float) -> float:
    """Chi-square of zero rate: omega^T (P + slack^2 I)^-1 omega (E-22)."""
    a, b, c = P[0, 0] + slack * slack, P[1, 1] + slack * slack, P[2, 2] + slack * slack
    d, e, f = P[0, 1], P[0, 2], P[1, 2]
    x, y, z = b * c - f * f, e * f - d * c, d * f - b * e
    det = a * x + d * y + e * z
    u, v, q = a * c - e * e, d * e - a * f, a * b - d * d
    o0, o1, o2 = omega[0], omega[1], omega[2]
    return (
        o0 * o0 * x + o1 * o1 * u + o2 * o2 * q + 2.0 * (o0 * o1 * y + o0 * o2 * z + o1 * o2 * v)
    ) / det


@lean
def began(w: Watch, s: Sensor, c: Limits) -> int:
    """0 while a standing body stands on; else how many samples ago it began to move (E-23,
    E-24).
    """
    worst, depth = 1.0, 0
    for k in range(len(LENGTHS)):
        length = LENGTHS[k]
        if w.n[LEARNING] < c.window or length >= min(w.n[STILL_FOR], w.n[FILLED] - 1):
            break
        ratio = _turned(w, s, length, c.drift_now) / c.turn_limit
        if ratio > worst:
            worst, depth = ratio, length + length // 2
    if (
        depth == 0
        and w.n[LEARNING] >= c.window
        and _tilted(w, s, c.window, c.drift_tilt) > c.tilt_limit
    ):
        depth = c.guard
    return min(depth, DEPTH - 8)


@lean
def _learn(w: Watch, c: Limits) -> None:
    """One more sample of standstill; the one `guard` samples ago becomes part of the reference."""
    w.n[STILL_FOR] += 1
    if w.n[STILL_FOR] <= c.guard:
        return
    y = w.y[(w.n[COUNT] - 1 - c.guard) % DEPTH]
    w.n[LEARNING] += 1
    for r in range(12):
        w.gathered[r] += y[r]
    if w.n[LEARNING] >= c.window:
        w.n[LEARNT] = w.n[LEARNING]
        for r in range(12):
            w.reference[r] = w.gathered[r] / w.n[LEARNING]


@lean
def _end(w: Watch) -> None:
    w.n[STILL_FOR] = w.n[LEARNING] = 0
    w.gathered[:] = 0.0


@lean
def _stands(w: Watch, s: Sensor, c: Limits, omega: Array, P: Array, dt: float) -> bool:
    if w.n[HOLD] > 0:
        w.n[HOLD] -= 1
    if (
        w.n[FILLED] < c.window
        or _scatter(w, s, c.window) > c.spread_limit * c.sigma_axis**2
        or w.n[HOLD] > 0
    ):
        w.n[QUIET_FOR] = w.n[SLOW_FOR] = 0
        return False
    told = rate_excludes_zero(omega, P, c.rate_slack)
    slow = told < c.rate_limit
    if not _settled(w, s, c, omega, P, told):
        w.n[QUIET_FOR] = w.n[SLOW_FOR] = 0
        return False
    if w.n[LEARNT] == 0 or (
        _moved(w, s, c.window, c.drift) <= c.quiet_limit
        and _moved(w, s, c.short_window, c.drift) <= c.quiet_limit
    ):
        w.n[QUIET_FOR], w.n[SLOW_FOR] = w.n[QUIET_FOR] + 1, 0
        return slow or w.n[QUIET_FOR] * dt >= c.patience_s
    w.n[QUIET_FOR], w.n[SLOW_FOR] = 0, w.n[SLOW_FOR] + 1 if slow else 0
    return w.n[SLOW_FOR] * dt >= 2.0 * c.patience_s


@lean
def detect(w: Watch, s: Sensor, c: Limits, omega: Array, P: Array, dt: float) -> tuple[bool, int]:
    """Is the sample taken last one of standstill, by the caller's omega (3,) and its covariance P
    (3, 3)?

    When a standstill ends: also how many samples ago the turn began.
    """
    standing = w.n[STILL_FOR] > 0
    still = _stands(w, s, c, omega, P, dt)
    depth = began(w, s, c) if standing else 0
    if still and depth == 0:
        _learn(w, c)
        return True, 0
    depth = (
        min(max(depth, 2 * c.window), w.n[STILL_FOR], DEPTH - 8)
        if standing and depth == 0
        else depth
    )
    _end(w)
    if standing:
        w.n[QUIET_FOR], w.n[HOLD] = 0, c.hold
    return False, depth
