"""What a filter does with one fix, and the compiled run over many samples and fixes. E-32 to E-47.

The live path and the batch path call the same functions on the same samples, so that their results
are the same to the bit. `run` is the batch; the live navigator calls `run_to` and `take` itself,
because its samples come one by one.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from inertial.navigation import fuzzy
from inertial.navigation.arrays import copy1, copy2, fill1
from inertial.navigation.constraints import Rules, constrain
from inertial.navigation.leg import Leg, Model, carry, close, copy_leg, correct, run_leg
from inertial.navigation.mechanise import NOMINAL, SINCE, TIME
from inertial.navigation.update import (
    F_HAS_V,
    F_T,
    F_WITHHELD,
    absorb,
    block_weights,
    consistent,
    factor,
    inflate,
    innovate,
    pick,
    residual,
)
from inertial.navigation.window import (
    ARRIVAL_KF,
    Window,
    arrival,
    forward,
    kf_beside,
    motion,
    push,
    robust,
)

Array = NDArray[np.float64]

LOW = 0.2  # weight of a fix that a robust filter hardly believes
USED, REJECTED, WITHHELD, LATE, READMITTED, DOUBTED = range(
    6
)  # what became of a fix; DOUBTED: with less weight

# columns of a row of results; the arrays that they hold follow one another
O_STATUS, O_NIS, O_DOF, O_Y, O_SIGMA, O_WEIGHT, O_N, O_CRISP, O_INPUT = (
    0,
    1,
    2,
    3,
    10,
    17,
    20,
    21,
    22,
)
O_YAW, O_ERROR, O_LEFT, O_X, O_P = (
    24,
    25,
    28,
    34,
    66,
)  # yaw rad, NED m, residual after, x, P of 9 states row-major
OUT = O_P + 81


class Settings(NamedTuple):
    """A filter's choices as the compiled code takes them."""

    gates: Array  # (8,) largest NIS by degrees of freedom
    readmit: int  # refusals in a row after which the filter is taken to be wrong
    fading: float  # factor on Phi P Phi^T, 1: none
    huber: float  # Mahalanobis distance from which a fix is weighted down; infinite: never
    window: int  # 0 none, 1 predictive estimator, 2 robust moving horizon
    horizon: int  # N; 0: fuzzy
    arrival: int  # ARRIVAL_*
    kappa: float
    passes: int  # of reweighting in the robust horizon
    literal: int  # 1: fuzzy inputs as read
    fuzzy: Array  # (16,) rules
    rules: Rules
    lever: Array  # (3,) m


class Memory(NamedTuple):
    """All of a filter's memory but its leg."""

    window: Window
    trial: Leg  # where a fix is tried
    counts: Array  # (2,) int64: refusals in a row, low weights in a row
    still_f: Array  # (1,) |mean f| at standstill, m/s^2
    scratch: Array  # (3, n, n)
    last: Array  # (n,) the estimate that the last fix used was answered with


@njit(cache=True)
def run_to(
    leg: Leg,
    m: Model,
    rules: Rules,
    scratch: Array,
    t: Array,
    f: Array,
    w: Array,
    start: int,
    stop: int,
    until: float,
) -> int:
    """Samples up to time `until`, with the constraints that come due; returns the first sample not
    used up.
    """
    k = start
    while k < stop:
        k = run_leg(leg, m, t, f, w, k, stop, until, rules.every)
        if leg.acc[SINCE] >= rules.every - 1e-6:
            constrain(leg, m, rules, scratch, scratch[2, 0])
            leg.acc[SINCE] = 0.0
        elif k < stop and t[k] > until and leg.acc[TIME] >= until:
            break
    return k


@njit(cache=True)
def take(leg: Leg, m: Model, s: Settings, mem: Memory, fix: Array, rate: Array, out: Array) -> int:
    """Judge and apply a fix (a row of the table) at the leg's time; rate (3,) is the measured one
    then.

    A fix that is withheld or refused leaves the leg as close() makes it: call on a copy. Fills out
    (OUT,), returns the status.
    """
    n = m.n
    window = mem.window
    y, H, R = np.empty(7), np.empty((7, n)), np.empty((7, 7))
    PHt, S, G, u, c = np.empty((n, 7)), np.empty((7, 7)), np.empty((7, 7)), np.empty(7), np.empty(n)
    close(leg, m)
    P = mem.scratch[0]
    carry(leg.P, leg.Phi, leg.Q, s.fading, mem.scratch[1], P)
    residual(leg, m, rate, s.lever, fix, y, H)
    rows = pick(fix, y, H, R)
    innovate(P, y, H, R, rows, PHt, S)
    nis = factor(S, y, rows, G, u)
    _say(leg, fix, y, S, rows, nis, rate, out)
    if fix[F_WITHHELD] > 0.0:
        return _answer(leg, P, out, WITHHELD)
    status, weight = USED, np.ones(3)
    if s.huber < 1e300 and s.window == 0:
        block_weights(S, y, rows, s.huber, G, u, weight)
    lowest = min(weight[0], weight[1], weight[2])
    # a robust filter that doubts fix after fix is as lost as one that refuses them
    mem.counts[1] = mem.counts[1] + 1 if lowest < LOW else 0
    if not nis <= s.gates[rows] or mem.counts[1] >= s.readmit:
        mem.counts[0] += 1
        if mem.counts[0] < s.readmit and mem.counts[1] < s.readmit:
            return _answer(leg, P, out, REJECTED)
        mem.counts[1] = 0
        # the filter is wrong, not the receiver: believe less of it, and nothing of what its horizon
        # holds
        consistent(P, y, H, R, rows, PHt, S, G, u)
        innovate(P, y, H, R, rows, PHt, S)
        status = READMITTED
        window.count[0] = 0
    elif lowest < 1.0:
        status = DOUBTED
        inflate(S, R, rows, weight)
    factor(S, y, rows, G, u)
    mem.counts[0] = 0
    for g in range(3):
        out[17 + g] = weight[g] if status == DOUBTED else 1.0
    if s.window == 0 or status == READMITTED:
        absorb(P, PHt, G, u, rows, c)
        copy2(P, window.Pk)
    else:
        _look_back(leg, m, s, mem, y, H, R, rows, P, c, out)
    copy2(P, leg.P)
    correct(leg, m, c)
    copy1(c, mem.last)
    residual(leg, m, rate, s.lever, fix, y, H)
    for i in range(6):
        out[O_LEFT + i] = y[i] if i < 3 or fix[F_HAS_V] > 0.0 else math.nan
    return _answer(leg, P, out, status)


@njit(cache=True)
def _look_back(
    leg: Leg,
    m: Model,
    s: Settings,
    mem: Memory,
    y: Array,
    H: Array,
    R: Array,
    rows: int,
    P: Array,
    c: Array,
    out: Array,
) -> None:
    """Solve the horizon that ends with this fix: c (n,) and P (n, n)."""
    window = mem.window
    own = s.window == 2
    push(window, leg.Phi, leg.Q, y, H, R, rows, leg.P if own else window.Pk)
    N = s.horizon
    out[O_CRISP] = N
    if N == 0:
        motion(leg, s.literal > 0, mem.still_f[0], out[O_INPUT : O_INPUT + 2])
        out[O_CRISP] = fuzzy.horizon(out[O_INPUT], out[O_INPUT + 1], s.fuzzy)
        N = fuzzy.fixes(out[O_CRISP])
    P_arr = np.empty((m.n, m.n))
    held = arrival(window, N, ARRIVAL_KF if own else s.arrival, s.kappa, P_arr)
    out[O_N] = held
    size = window.y.shape[0]
    scale = np.ones((size, 3))
    if own:
        smoothed = np.empty((size, m.n))
        newest = robust(window, held, P_arr, s.huber, s.passes, scale, smoothed)
        for g in range(3):
            out[17 + g] = scale[held - 1, g]
    else:
        newest = forward(window, held, P_arr, scale)
    copy1(window.m[newest, 1], c)
    copy2(window.P[newest, 1], P)
    copy1(c, window.c[newest])
    if not own:
        kf_beside(window)


@njit(cache=True)
def _say(
    leg: Leg, fix: Array, y: Array, S: Array, rows: int, nis: float, rate: Array, out: Array
) -> None:
    """What the fix says, before anything is done with it."""
    fill1(out, math.nan)
    out[O_NIS], out[O_DOF], out[O_N] = nis, rows, 0.0
    for i in range(rows):
        out[O_Y + i] = y[i]
        out[O_SIGMA + i] = math.sqrt(S[i, i])
    for g in range(3):
        out[O_WEIGHT + g] = 1.0
    x = leg.x
    # a course is the heading of the moment that the receiver's velocity is of
    turn = 0.0
    if abs(x[28]) > 0.0:
        D0 = x[12] * (rate[0] - x[18]) + x[13] * (rate[1] - x[19]) + x[14] * (rate[2] - x[20])
        turn = D0 * x[28]
    out[O_YAW] = math.atan2(x[9], x[6]) - turn
    out[O_ERROR], out[O_ERROR + 1], out[O_ERROR + 2] = y[0], y[1], -y[2]


@njit(cache=True)
def _answer(leg: Leg, P: Array, out: Array, status: int) -> int:
    out[O_STATUS] = status
    for i in range(NOMINAL):
        out[O_X + i] = leg.x[i]
    for i in range(9):
        for j in range(9):
            out[O_P + 9 * i + j] = P[i, j]
    return status


@njit(cache=True)
def run(
    leg: Leg,
    m: Model,
    s: Settings,
    mem: Memory,
    t: Array,
    f: Array,
    w: Array,
    start: int,
    stop: int,
    fixes: Array,
    out: Array,
) -> int:
    """Samples start..stop-1 and all fixes (k, FIX_COLUMNS) among them, in order; out (k, OUT) gets
    the results.

    Returns the first sample not used, which is `stop`.
    """
    k = start
    for j in range(fixes.shape[0]):
        when = fixes[j, F_T]
        if when < leg.acc[TIME] - 1e-9:
            fill1(out[j], math.nan)
            out[j, O_STATUS] = LATE
            continue
        end = k
        while end < stop and t[end] <= when:
            end += 1
        k = run_to(leg, m, s.rules, mem.scratch, t, f, w, k, end, math.inf)
        copy_leg(leg, mem.trial)
        run_to(mem.trial, m, s.rules, mem.scratch, t, f, w, k, min(k + 1, stop), when)
        status = take(mem.trial, m, s, mem, fixes[j], w[min(k, stop - 1)], out[j])
        if status == USED or status == READMITTED or status == DOUBTED:
            copy_leg(mem.trial, leg)
    return run_to(leg, m, s.rules, mem.scratch, t, f, w, k, stop, math.inf)
