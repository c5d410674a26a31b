"""From samples to states: start, standstill, the taking back of unnoticed turns, two signs at once;
compiled.

A turn begins before the detector sees it. The filter keeps its states of the last 128 samples of
standstill, every eighth; when a turn is noticed it goes back to where that began and runs those
samples again as turning. At a start while turning the products give omega but for its sign. The
first samples are fitted for both (products_start.py), then two filters run, until what they say of
omega' and of gravity's turn tells the signs apart (E-46).
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from inertial.rate import still as stillness
from inertial.rate.compiling import lean, making
from inertial.rate.observed import Sensor
from inertial.rate.products_kernel import (
    DENSITY,
    FORCE_USED,
    HORIZON,
    MISFIT,
    OUT,
    P_N,
    PP,
    Q_NB,
    SIZE,
    USED,
    V_N,
    WORK,
    Tuning,
)
from inertial.rate.products_model import STATES, TURNED
from inertial.rate.products_start import (
    FEWEST,
    FITS,
    MOST,
    SURE_FROM,
    begin,
    begin_turning,
    carry,
    mean,
    turning,
)
from inertial.rate.products_step import back, step
from inertial.rate.still import COUNT, DEPTH, FILLED, Limits, Watch

Array = NDArray[np.float64]

EVERY = 8  # samples between states that are kept
KEPT = DEPTH // EVERY + 1
ARRIVALS = 4
WINDOW = 24  # samples of the moving horizon
ITERATIONS = 2  # of Gauss and Newton
# of Memory.marks
(
    STARTED,
    STILL,
    MOVED,
    BRANCHES,
    REFUSED,
    REFUSED_FORCE,
    TAKEN_BACK,
    STEPS,
    FREE,
    UNLIKE,
    FITTED,
    LOST,
) = range(12)
LAST_S, DT, BALANCE = range(3)  # of Memory.clock
LONGEST_GAP_S = 0.5  # s; after a longer one the rate is unknown
UNKNOWN_RATE = 10.0  # rad/s, sigma before any standstill
ALWAYS_UNLIKE = (
    50  # samples in a row whose force was refused, after which u and the pivot are found anew
)
DECIDED = (
    14.0  # log of the likelihood ratio of two signs at which one is dropped: one wrong in a million
)

# All that one filter remembers, beside the detector's Watch.
MEMORY = np.dtype(
    (
        np.record,
        [
            ("core", "f8", (SIZE,)),  # flat state of products_kernel
            ("other", "f8", (SIZE,)),  # of the other sign, while there are two
            ("kept", "f8", (KEPT, SIZE)),  # states before samples of this standstill
            ("kept_at", "i8", (KEPT,)),  # the samples' numbers; -1: none
            ("out", "f8", (OUT,)),
            ("other_out", "f8", (OUT,)),
            (
                "arrival",
                "f8",
                (ARRIVALS, SIZE),
            ),  # of the moving horizon: states before samples of this turn
            ("arrival_at", "i8", (ARRIVALS,)),
            ("end", "f8", (6,)),  # of the moving horizon: omega and b_alpha at the newest sample
            ("marks", "i8", (12,)),
            ("clock", "f8", (3,)),
            ("work", "f8", (WORK,)),  # of one step, of no meaning after it
        ],
    )
)
Memory = np.record
VECTOR = 64  # bytes
FASTEST = (
    120.0  # rad/s; +-16 g at 5 cm of the axis is 56 rad/s: beyond twice that a filter has diverged
)


def memory() -> Memory:
    """Before any sample. The workspace begins where whole vectors do: that makes a sample a tenth
    cheaper.
    """
    room = np.zeros(MEMORY.itemsize + VECTOR, np.uint8)
    first = -(room.ctypes.data + MEMORY.fields["work"][1]) % VECTOR
    m = room[first : first + MEMORY.itemsize].view(MEMORY)[0]
    m.kept_at[:] = m.arrival_at[:] = -1
    m.core[Q_NB] = m.other[Q_NB] = 1.0
    m.clock[:] = (np.nan, 0.01, 0.0)
    return m


@lean
def put(target: Array, source: Array) -> None:
    """target becomes the first numbers of source; an assignment would ask whether they overlap, and
    copy.
    """
    for k in range(len(target)):
        target[k] = source[k]


@lean
def gap(m: Memory, w: Watch) -> None:
    """Samples are missing: the next step predicts across."""
    stillness.forget(w)
    m.kept_at[:] = m.arrival_at[:] = -1
    m.marks[FITTED] = 0


@lean
def restart(m: Memory, w: Watch) -> None:
    """The rate is unknown: wait for a standstill, or start while turning."""
    gap(m, w)
    m.marks[STARTED] = m.marks[STILL] = m.marks[MOVED] = m.marks[BRANCHES] = 0
    m.core[:] = 0.0
    m.core[Q_NB] = 1.0


@making
def _begin_still(m: Memory, w: Watch, s: Sensor, t: Tuning, c: Limits) -> None:
    begin(m.core, s, t, mean(w, c.window), s.theta_b)
    m.marks[STARTED], m.marks[BRANCHES] = 1, 1


@lean
def _take_back(m: Memory, depth: int, now: int) -> int:
    """Core becomes the state before sample now - depth, or the nearest that is kept; returns that
    sample.
    """
    best = -1
    for k in range(KEPT):
        at = m.kept_at[k]
        if at < 0 or at > now or now - at >= DEPTH:
            continue
        if best < 0 or abs(at - (now - depth)) < abs(m.kept_at[best] - (now - depth)):
            best = k
    first = now
    if best >= 0:
        put(m.core, m.kept[best])
        first = m.kept_at[best]
    m.marks[TAKEN_BACK] += now - first
    m.kept_at[:] = -1
    return first


@lean
def _two_signs(m: Memory, still: bool) -> None:
    """Keep the better one of two signs in core, and only that once it is sure."""
    m.clock[BALANCE] += np.log(m.out[DENSITY] / m.other_out[DENSITY]) - 0.5 * (
        m.out[MISFIT] - m.other_out[MISFIT]
    )
    if m.clock[BALANCE] < 0.0:
        for k in range(len(m.core)):
            m.core[k], m.other[k] = m.other[k], m.core[k]
        for k in range(OUT):
            m.out[k], m.other_out[k] = m.other_out[k], m.out[k]
        m.clock[BALANCE] = -m.clock[BALANCE]
    if still or m.clock[BALANCE] > DECIDED:
        m.marks[BRANCHES] = 1


@making
def _fit(m: Memory, w: Watch, s: Sensor, t: Tuning) -> float:
    """Both signs anew; how much likelier the first is. By few samples that is not known well: at
    most e^2.
    """
    n = m.marks[FITTED]
    ratio = begin_turning(m.core, m.other, m.kept[0], m.kept[1], w, s, t, n)
    return ratio if n >= SURE_FROM else min(ratio, 2.0)


@making
def _fit_start(m: Memory, w: Watch, s: Sensor, t: Tuning, c: Limits, still: bool) -> None:
    """One more sample of a start while turning: fitted anew now and then, carried on between
    (E-46).
    """
    m.marks[FITTED] += 1
    n = m.marks[FITTED]
    if still:  # it was no turn
        _begin_still(m, w, s, t, c)
        m.marks[MOVED] = m.marks[FITTED] = 0
    elif n in FITS:
        m.clock[BALANCE] = _fit(m, w, s, t)
        m.marks[BRANCHES] = 1 if m.clock[BALANCE] > DECIDED else 2
    else:
        k = (w.n[COUNT] - 1) % DEPTH
        carry(m.core, m.work, w.y[k], w.dt[k], s, t)
        carry(m.other, m.work, w.y[k], w.dt[k], s, t)
    if n >= MOST:  # from here a filter, that does not know yet whether the axis is fixed
        m.marks[FITTED], m.marks[FREE] = 0, 200


@lean
def _diverged(m: Memory, w: Watch) -> bool:
    """Start anew when the rate is beyond all bounds or no number at all, or its covariance is none
    any more.
    """
    x, P = m.core[0:3], m.core[STATES:PP]
    if (
        x[0] ** 2 + x[1] ** 2 + x[2] ** 2 < FASTEST**2
        and P[0] > 0.0
        and P[23] > 0.0
        and P[46] > 0.0
    ):
        return False
    m.marks[LOST] += 1
    restart(m, w)
    m.out[:] = 0.0
    return True


@lean
def _horizon(m: Memory, t: Tuning, still: bool, now: int) -> int:
    """First sample of the moving horizon's window when it is due and all of it was turning; else -1
    (E-49).
    """
    first = now + 1 - WINDOW
    if t.method != HORIZON or still or first < 0 or first % EVERY != 0 or m.marks[BRANCHES] != 1:
        return -1
    return first if m.arrival_at[(first // EVERY) % ARRIVALS] == first else -1


@lean
def _on_axis(m: Memory, w: Watch, s: Sensor, t: Tuning) -> bool:
    """Does omega keep its direction? Not while omega' across it, summed over 16 or 64 samples, is
    more than noise.

    A body found to turn freely is taken for one for at least 2 s, and omega's variance across grows
    (E-45).
    """
    core = m.core
    square = core[0] ** 2 + core[1] ** 2 + core[2] ** 2
    if t.axis == 0.0 or square <= t.axis_from:
        return False
    now = (w.n[COUNT] - 1) % (2 * DEPTH)
    for length in (16, 64):
        if w.n[FILLED] <= length:
            break
        then = (w.n[COUNT] - 1 - length) % (2 * DEPTH)
        across, along = 0.0, 0.0
        for i in range(3):
            d = w.total[now, i] - w.total[then, i] - length * core[3 + i]
            across += d * d
            along += d * core[i]
        across -= along * along / square
        if across > t.axis_limit * length * s.R_alpha[0, 0] and m.marks[FREE] < 200:
            if m.marks[FREE] == 0:
                for i in range(3):
                    core[STATES + STATES * i + i] += t.axis_lost
            m.marks[FREE] = 200
    if m.marks[FREE] > 0:
        m.marks[FREE] -= 1
    return m.marks[FREE] == 0


@njit(cache=True, error_model="numpy", inline="always")
def advance(m: Memory, w: Watch, s: Sensor, t: Tuning, c: Limits, t_s: float, a: Array) -> None:
    """One sample of all axes a (N,), m/s^2, read at t_s (s, growing)."""
    dt = t_s - m.clock[LAST_S]
    m.clock[LAST_S] = t_s
    if dt > LONGEST_GAP_S:
        restart(m, w)
    elif dt > 0.0:
        m.clock[DT] = dt
    dt = m.clock[DT]
    m.marks[STEPS] += 1
    stillness.take(w, s, a, dt)
    m.out[:] = 0.0
    P = m.core[STATES:PP].reshape(STATES, STATES)
    if m.marks[STARTED] == 0:
        P[0, 0] = P[1, 1] = P[2, 2] = UNKNOWN_RATE**2
    still, depth = stillness.detect(w, s, c, m.core[0:3], P[0:3, 0:3], dt)
    if m.marks[STARTED] == 0:
        m.marks[STILL] = 1 if still else 0
        if still:
            _begin_still(m, w, s, t, c)
        elif turning(w, s, t):
            m.marks[STARTED], m.marks[BRANCHES], m.marks[MOVED], m.marks[FITTED] = 1, 2, 1, FEWEST
            m.clock[BALANCE] = _fit(m, w, s, t)
        return
    if m.marks[FITTED] > 0:
        m.marks[STILL] = 1 if still else 0
        _fit_start(m, w, s, t, c, still)
        _diverged(m, w)
        return
    now = w.n[COUNT] - 1
    first = now
    if still and now % EVERY == 0:
        put(m.kept[(now // EVERY) % KEPT], m.core)
        m.kept_at[(now // EVERY) % KEPT] = now
    elif not still and m.marks[STILL]:
        m.marks[MOVED] = 1
        first = _take_back(m, depth, now)
    m.marks[STILL] = 1 if still else 0
    fixed = not still and _on_axis(m, w, s, t)
    if still:
        m.arrival_at[:] = -1
    at = (np.nan, np.nan, np.nan)
    for turn in range(1 + ITERATIONS):
        if turn > 0:
            first = _horizon(m, t, still, now)
            if first < 0:
                break
            put(m.end, m.core)
            put(m.core, m.arrival[(first // EVERY) % ARRIVALS])
        for sample in range(first, now + 1):
            k = sample % DEPTH
            grow = EVERY * dt if sample % EVERY == 0 else 0.0
            if sample % EVERY == 0 and t.method == HORIZON and not still:
                put(m.arrival[(sample // EVERY) % ARRIVALS], m.core)
                m.arrival_at[(sample // EVERY) % ARRIVALS] = sample
            if turn > 0:  # back from the end by what omega' was since
                at = back(
                    m.end,
                    w.total[now % (2 * DEPTH)],
                    w.total[sample % (2 * DEPTH)],
                    now - sample,
                    dt,
                )
            for branch in range(m.marks[BRANCHES]):
                core, out = (m.core, m.out) if branch == 0 else (m.other, m.other_out)
                step(core, m.work, s, t, w.y[k], at, w.dt[k], not still, fixed, grow, out)
    if m.marks[BRANCHES] == 2:
        _two_signs(m, still)
    if _diverged(m, w):
        return
    if still and m.marks[MOVED] == 0:  # position counts from the end of the first standstill
        m.core[V_N : P_N + 3] = 0.0
        m.core[TURNED] = 0.0
        P[TURNED, :] = 0.0
        P[:, TURNED] = 0.0
    if m.out[USED] == 0.0:
        m.marks[REFUSED] += 1
    if m.out[FORCE_USED] == 1.0:
        m.marks[UNLIKE] = 0
        return
    m.marks[REFUSED_FORCE] += 1
    m.marks[UNLIKE] += 1
    if (
        m.marks[UNLIKE] % ALWAYS_UNLIKE == 0
    ):  # not one bump: gravity's direction or the pivot is not what was believed
        for i in range(3):
            P[12 + i, 12 + i] += t.tilt
            P[18 + i, 18 + i] += t.pivot
